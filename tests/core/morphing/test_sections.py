from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from shapes import closed_surface, ring
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkFiltersCore import vtkPolyDataPlaneCutter, vtkStripper
from vtkmodules.vtkFiltersSources import vtkSphereSource

from vtkmuscle.core.mesh.surface import opposite_half_edges
from vtkmuscle.core.morphing.sections import cut_surface
from vtkmuscle.data.arrays import points_of, surface_from, triangles_of

TETRAHEDRON = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
FACES = np.array([(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)])


def sphere(resolution=24):
    source = vtkSphereSource(radius=1.0, theta_resolution=resolution, phi_resolution=resolution)
    source.Update()
    return points_of(source.GetOutput()), triangles_of(source.GetOutput(), "sphere")


def torus():
    return ring(big=2.0, small=0.7, n_around=40, n_across=20)


def cut(points, triangles, levels, values=None):
    values = points[:, 2].copy() if values is None else values
    return cut_surface(closed_surface(points, triangles), values, np.asarray(levels, dtype=float))


def loops(sections, level):
    return [sections.loop(number) for number in sections.loops_of(level)]


def area(loop):
    x, y = loop[:, 0], loop[:, 1]
    return 0.5 * float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum())


def length(loop):
    return float(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).sum())


def loops_by_vtk(points, triangles, level):
    cutter = vtkPolyDataPlaneCutter(plane=vtkPlane(origin=(0, 0, level), normal=(0, 0, 1)))
    cutter.SetInputData(surface_from(points, triangles))
    stripper = vtkStripper(join_contiguous_segments=True)
    stripper.SetInputConnection(cutter.GetOutputPort())
    stripper.Update()
    lines = stripper.GetOutput().GetLines()
    offsets, ids = (vtk_to_numpy(array) for array in (lines.GetOffsetsArray(), lines.GetConnectivityArray()))
    places = points_of(stripper.GetOutput())
    return [places[ids[a : b - 1]] for a, b in pairwise(offsets)]


@pytest.mark.parametrize("surface", [sphere, torus])
def test_a_surface_that_faces_inward_is_turned_with_its_opposite_half_edges(surface):
    points, triangles = surface()
    turned = closed_surface(points, triangles[:, ::-1]).outward()
    assert np.array_equal(turned.triangles, triangles)
    assert np.array_equal(turned.opposite, opposite_half_edges(triangles))
    assert closed_surface(points, triangles).outward().triangles is not turned.triangles


@pytest.mark.parametrize("triangles", [FACES[:3], np.vstack([FACES[:3], FACES[3:, ::-1]])])
def test_an_open_or_inconsistent_surface_is_refused(triangles):
    with pytest.raises(ValueError, match="must be closed and oriented"):
        opposite_half_edges(triangles)


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_loops_are_those_of_vtk(seed):
    rng = np.random.default_rng(seed)
    points, triangles = torus()
    points = points @ Rotation.random(random_state=seed).as_matrix().T
    levels = np.sort(rng.uniform(points[:, 2].min(), points[:, 2].max(), 5))
    sections = cut(points, triangles, levels)
    for i, level in enumerate(levels):
        mine, theirs = loops(sections, i), loops_by_vtk(points, triangles, level)
        assert sorted(length(loop) for loop in mine) == pytest.approx(
            sorted(length(loop) for loop in theirs), abs=1e-5
        )
        assert all(np.abs(loop[:, 2] - level).max() < 1e-12 for loop in mine)
        # Areas of holes count negative: the sum is that of the section.
        assert sum(area(loop) for loop in mine) > 0


def test_a_level_through_points_and_edges_gives_one_loop_of_their_points():
    points, triangles = sphere(16)
    level = np.unique(points[:, 2].round(12))[5]
    on_level = np.flatnonzero(np.abs(points[:, 2] - level) < 1e-9)
    points[on_level, 2] = level
    (loop,) = loops(cut(points, triangles, [level]), 0)
    assert {tuple(p) for p in loop} == {tuple(p) for p in points[on_level]}
    assert area(loop) > 0


def test_a_flat_face_on_a_level_is_no_trap():
    for level, n in ((0.0, 0), (1e-9, 1), (1.0, 0), (1.0 - 1e-6, 1), (-1.0, 0), (2.0, 0)):
        assert len(loops(cut(TETRAHEDRON, FACES, [level]), 0)) == n


def test_levels_inside_a_hollow_run_the_other_way_round():
    points, triangles = sphere()
    both = np.vstack([points, 0.5 * points])
    shells = np.vstack([triangles, triangles[:, ::-1] + len(points)])
    areas = sorted(area(loop) for loop in loops(cut(both, shells, [0.1]), 0))
    assert len(areas) == 2
    assert areas[0] < 0 < areas[1]


def two_legs():
    """Return heights on a torus stood upright: one loop, two legs, one loop."""
    points, triangles = torus()
    return points[:, [1, 2, 0]].copy(), triangles


def test_parts_say_which_loops_the_surface_joins():
    points, triangles = two_legs()
    sections = cut(points, triangles, [-2.0, -0.5, 0.5, 2.0])
    assert [len(sections.loops_of(i)) for i in range(4)] == [1, 2, 2, 1]
    (bottom,), lower, upper, (top,) = (list(sections.loops_of(i)) for i in range(4))
    above, below = sections.parts_above, sections.parts_below
    assert all(above[bottom] == below[leg] for leg in lower)
    assert all(above[leg] == below[top] for leg in upper)
    # Each leg goes on in one loop only, the one on its own side.
    for leg in lower:
        (onward,) = [other for other in upper if above[leg] == below[other]]
        assert np.dot(sections.loop(leg).mean(axis=0)[:2], sections.loop(onward).mean(axis=0)[:2]) > 0
    lowest = np.flatnonzero(sections.vertex_parts == below[bottom])
    assert points[lowest, 2].max() < -2.0
    assert points[lowest, 2].min() == points[:, 2].min()


def test_loops_of_isolated_extrema_are_left_out_and_do_not_cut():
    points, triangles = sphere()
    sections = cut(points, triangles, [points[:, 2].max()])
    assert len(sections.loop_offsets) == 1
    assert len(np.unique(sections.vertex_parts)) == 1


def test_isolines_of_any_function_on_the_points():
    points, triangles = sphere()
    (loop,) = loops(cut(points, triangles, [0.7], values=np.linalg.norm(points - [0, 0, 1], axis=1)), 0)
    assert np.ptp(np.linalg.norm(loop - [0, 0, 1], axis=1)) < 0.02
    # The function grows downwards: seen from above, the other way round.
    assert area(loop) < 0
