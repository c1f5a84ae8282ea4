"""Memory does not grow from update to update: in a short form always, in a long one on request."""

import ctypes
import gc
import tracemalloc

import numpy as np
import pytest
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter
from vtkmodules.vtkFiltersSources import vtkCubeSource, vtkSphereSource

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.data.arrays import (
    Polylines,
    multiblock_from,
    points_of,
    polylines_from,
    set_point_array,
    surface_from,
    triangles_of,
    with_points,
)
from vtkmuscle.filters import BoneMotion, FibreMetrics, FibreTransport, FibreTubes, PathDeformer, TautPaths
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.ports import InputPort, OutputPort

ANGLES = np.arange(0.0, 21.0, 2.0)
#: Growth per update that is noise: caches of Python and VTK, fragments [bytes].
NOISE_PER_UPDATE = 2000


class _Mallinfo(ctypes.Structure):
    """What glibc says of its heap, struct mallinfo2."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in [
            "arena",
            "ordblks",
            "smblks",
            "hblks",
            "hblkhd",
            "usmblks",
            "fsmblks",
            "uordblks",
            "fordblks",
            "keepcost",
        ]
    ]


def in_use():
    """Return the memory in use by Python, NumPy and VTK [bytes].

    The size of the process would not do: a leak of megabytes fits into what was freed before.
    """
    library = ctypes.CDLL(None)
    if not hasattr(library, "mallinfo2"):
        pytest.skip("this C library does not tell how much memory is in use (glibc 2.33 does)")
    library.mallinfo2.restype = _Mallinfo
    gc.collect()
    info = library.mallinfo2()
    return info.uordblks + info.hblkhd


def bones():
    """Return two bars behind the muscle."""
    blocks = {}
    for name, z in (("lower", -30.0), ("upper", 30.0)):
        cube = vtkCubeSource(x_length=10, y_length=10, z_length=40, center=(0, 25.0, z))
        triangles = (cube >> vtkTriangleFilter()).update().output
        blocks[name] = surface_from(points_of(triangles), triangles_of(triangles, "cube"))
    return multiblock_from(blocks)


def scene(n_slices, n_sides):
    """Return the end of a chain over a spindle between two bars, and its number of triangles."""
    source = vtkSphereSource(radius=0.5, theta_resolution=n_sides, phi_resolution=n_slices)
    source.SetOutputPointsPrecision(1)
    source.Update()
    points = points_of(source.GetOutput()) * [24.0, 24.0, 100.0]
    triangles = triangles_of(source.GetOutput(), "sphere")
    muscle = surface_from(points, triangles)
    fixed_to = np.where(points[:, 2] < -40, 0, np.where(points[:, 2] > 40, 1, -1))
    set_point_array(muscle, "FixedTo", fixed_to.astype(np.int32))
    motion = hinge("upper", (0.0, 25.0, 0.0), (1, 0, 0), ANGLES)
    posed = {"rest_bones": bones(), "bones": BoneMotion(bones=bones(), motion=motion)}
    paths = TautPaths(rest_muscle=muscle, checkpoint_memory=0.0, **posed)
    deformer = PathDeformer(muscle=muscle, paths=paths, iterations=2, **posed)
    along = np.linspace(-40.0, 40.0, 16)
    lines = [np.column_stack([0 * along + x, 0 * along, along]) for x in (-2.0, 0.0, 2.0)]
    transport = FibreTransport()
    for port, data in enumerate(
        (polylines_from(Polylines(np.vstack(lines), np.arange(4) * 16)), muscle, deformer)
    ):
        transport.connect(port, data)
    return (transport >> FibreMetrics() >> FibreTubes()).last, deformer, len(triangles)


def growth_per_update(update, count):
    """Return how much memory is more in use after each of the last updates, on average [bytes]."""
    for i in range(count // 4 + 12):  # caches fill, memory is divided up
        update(i)
    before = in_use()
    for i in range(count):
        update(i)
    return (in_use() - before) / count


class Leaks(Filter):
    """Keep a copy of each output.

    Raises
    ------
    ValueError
        Never.
    """

    muscle = InputPort(vtkPolyData, doc="A surface.")
    output = OutputPort(vtkPolyData, doc="The same.")

    def __init__(self, **parameters):
        self._kept = []
        super().__init__(**parameters)

    def execute(self, muscle):
        result = with_points(muscle, points_of(muscle))
        self._kept.append(result)
        return result


def check_no_growth(n_slices, n_sides, count):
    last, deformer, n_triangles = scene(n_slices, n_sides)

    def update(i):
        time = float(ANGLES[i % len(ANGLES)])
        last.update(time=time)
        deformer.update(time=time)

    grown = growth_per_update(update, count)
    frame = 48 * deformer.update().output.GetNumberOfPoints()
    assert grown < max(NOISE_PER_UPDATE, frame / 20), (
        f"{grown:.0f} bytes per update of {n_triangles} triangles"
    )
    return last, deformer, update, frame


def test_memory_does_not_grow_and_a_planted_leak_is_caught():
    _, deformer, update, frame = check_no_growth(60, 40, 60)
    leak = Leaks()
    leak.connect(0, deformer)
    leaked = growth_per_update(lambda i: (update(i), leak.update(time=float(ANGLES[i % len(ANGLES)]))), 11)
    assert leaked > max(NOISE_PER_UPDATE, frame / 20)


def test_python_objects_do_not_grow():
    last, *_ = scene(20, 12)
    for time in ANGLES:
        last.update(time=float(time))
    tracemalloc.start()
    try:
        # What is kept all the time, as the last frames with their strings, is to be counted before, too.
        for time in ANGLES:
            last.update(time=float(time))
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        for i in range(60):
            last.update(time=float(ANGLES[i % len(ANGLES)]))
        gc.collect()
        assert (tracemalloc.get_traced_memory()[0] - before) / 60 < NOISE_PER_UPDATE
    finally:
        tracemalloc.stop()


@pytest.mark.study
def test_memory_does_not_grow_over_500_updates_of_20_000_triangles():
    *_, n_triangles = scene(102, 101)
    assert n_triangles >= 20_000
    check_no_growth(102, 101, 500)
