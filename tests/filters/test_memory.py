"""Memory does not grow from update to update."""

import ctypes
import gc

import numpy as np
import pytest
from shapes import lines_of
from test_pbd_deformer import bones, spindle

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.data.arrays import shallow_copy
from vtkmuscle.filters import BoneMotion, FibreMetrics, FibreTransport, FibreTubes, PathDeformer, TautPaths

ANGLES = np.arange(0.0, 21.0, 2.0)
#: Growth per update that is noise: caches of Python and VTK, fragments [bytes].
NOISE_PER_UPDATE = 2000


class Mallinfo(ctypes.Structure):
    """glibc's struct mallinfo2; field 4 is hblkhd, memory by mmap, and field 7 uordblks, memory in use."""

    _fields_ = [(f"field_{i}", ctypes.c_size_t) for i in range(10)]


def in_use():
    """Return the memory in use by Python, NumPy and VTK [bytes].

    The size of the process would not do: a leak of megabytes fits into what was freed before.
    """
    library = ctypes.CDLL(None)
    if not hasattr(library, "mallinfo2"):
        pytest.skip("this C library does not tell how much memory is in use (glibc 2.33 does)")
    library.mallinfo2.restype = Mallinfo
    gc.collect()
    info = library.mallinfo2()
    return info.field_4 + info.field_7


def chain():
    """Return the end of a chain over a spindle of 2 200 triangles between two bars, and its deformer."""
    muscle = spindle(around=28, along=40)
    motion = hinge("upper", (0.0, 25.0, 0.0), (1, 0, 0), ANGLES)
    posed = {"rest_bones": bones(), "bones": BoneMotion(bones=bones(), motion=motion)}
    paths = TautPaths(rest_muscle=muscle, checkpoint_memory=0.0, **posed)
    deformer = PathDeformer(muscle=muscle, paths=paths, iterations=2, **posed)
    along = np.linspace(-40.0, 40.0, 16)
    lines = [np.column_stack([0 * along + x, 0 * along, along]) for x in (-2.0, 0.0, 2.0)]
    fibres = lines_of(lines)
    transport = FibreTransport(rest_fibres=fibres, rest_muscle=muscle, deformed_muscle=deformer)
    return (transport >> FibreMetrics() >> FibreTubes()).last, deformer


def growth_per_update(update, count):
    """Return how much memory is more in use after each of the last updates, on average [bytes]."""
    for i in range(count // 4 + 12):  # caches fill, memory is divided up
        update(i)
    before = in_use()
    for i in range(count):
        update(i)
    return (in_use() - before) / count


def test_memory_does_not_grow_and_a_planted_leak_is_caught():
    last, deformer = chain()
    kept = []

    def update(i):
        time = float(ANGLES[i % len(ANGLES)])
        last.update(time=time)
        deformer.update(time=time)

    def leaking(i):
        update(i)
        kept.append(shallow_copy(deformer.output))

    growth = growth_per_update(update, 60)
    allowed = max(NOISE_PER_UPDATE, 48 * deformer.output.GetNumberOfPoints() / 20)
    assert growth < allowed
    assert growth_per_update(leaking, 11) > allowed
