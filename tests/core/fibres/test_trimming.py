import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from oracles import igl
from scipy.spatial import cKDTree
from shapes import nearest_other, turns_of

from vtkmuscle.core.fibres.trimming import (
    EndArea,
    assign_positions,
    closest_to_ray,
    ends_as_printed,
    trim_fibres,
)
from vtkmuscle.core.mesh.sampling import PatchSamples
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.phantoms.meshing import solid_of_revolution

RADIUS, LENGTH = 10.0, 100.0
AXIS = np.array([0.0, 0.0, 1.0])


def rod():
    """Return a cylinder along z, from 0 to 100 mm."""
    return solid_of_revolution(np.linspace(0, LENGTH, 41), np.full(41, RADIUS), 24)


def area(where, extremal):
    """Return the area of the rod's points for which `where` is true, with landmarks up to a height."""
    points, triangles = rod()
    patch = np.flatnonzero(where(points))
    landmarks = np.array([[RADIUS, 0, extremal], [0, RADIUS, points[patch, 2].mean()]])
    return EndArea(landmarks, PatchSamples(points, triangles, patch))


def into_rod(places):
    beside = np.maximum(np.hypot(places[:, 0], places[:, 1]) / RADIUS, 1.0)
    return np.column_stack([places[:, :2] / beside[:, None], places[:, 2].clip(0, LENGTH)])


BOTTOM = {"where": lambda p: p[:, 2] <= 10, "extremal": 10.0}
TOP = {"where": lambda p: p[:, 2] >= 90, "extremal": 90.0}


def trimmed(lines, *, origin=None, insertion=None, largest_cut=0.4, inside=into_rod):
    count = lines.shape[1]
    offsets = np.arange(0, lines.shape[0] * count + 1, count)
    result = trim_fibres(
        lines.reshape(-1, 3),
        offsets,
        axis=AXIS,
        areas=(origin or area(**BOTTOM), insertion or area(**TOP)),
        limits=(inside, 0.6, largest_cut),
    )
    return result.reshape(lines.shape)


def parallel(n=40, count=17, radius=8.0):
    """Return straight fibres along the rod."""
    i = np.arange(n) + 0.5
    r, angle = radius * np.sqrt(i / n), np.pi * (1 + 5**0.5) * i
    feet = np.column_stack([r * np.cos(angle), r * np.sin(angle), 0 * i])
    return feet[:, None] + LENGTH * np.linspace(0, 1, count)[:, None] * AXIS


def pinched(n=40, count=17):
    """Return fibres that meet in a point at both ends, as those of a template do in the tips of a muscle."""
    lines = parallel(n, count)
    lines[:, :, :2] *= np.sin(np.pi * np.linspace(0, 1, count))[:, None]
    return lines


def distance_to_patch(places, end):
    surface = end.samples.points, end.samples.faces
    return np.sqrt(igl.point_mesh_squared_distance(np.ascontiguousarray(places), *surface)[0])


@pytest.mark.parametrize("fibres", [parallel(), pinched(), parallel(count=2), parallel(count=3)])
def test_fibres_begin_and_end_on_the_areas(fibres):
    result = trimmed(fibres)
    assert_allclose(distance_to_patch(result[:, 0], area(**BOTTOM)), 0, atol=1e-9)
    assert_allclose(distance_to_patch(result[:, -1], area(**TOP)), 0, atol=1e-9)


@pytest.mark.parametrize("fibres", [parallel, pinched])
def test_fibres_do_not_meet_but_are_spread_over_the_area(fibres):
    result = trimmed(fibres())
    for end in (0, -1):
        # The end face alone would give each fibre a disc of this diameter.
        own = 2 * RADIUS / np.sqrt(len(result))
        assert nearest_other(result[:, end]).min() > 0.4 * own


@pytest.mark.parametrize("count", [30, 40, 77])
def test_each_fibre_ends_at_an_equal_share_of_the_area(count):
    """Ends far from each other would crowd at the rim, and at the narrow end of a wedge."""
    wedge = area(lambda p: (p[:, 2] <= 40) & (p[:, 0] > 9.5 * p[:, 2] / 40), 40.0)
    ends = trimmed(parallel(count), origin=wedge, largest_cut=0.5)[:, 0]
    everywhere = wedge.samples.dense(2**15, seed=1)
    assert_allclose(ends.mean(axis=0), everywhere.mean(axis=0), atol=0.3)
    sizes = np.bincount(cKDTree(ends).query(everywhere)[1], minlength=count) * count / len(everywhere)
    assert sizes.std() < 0.25


def test_between_the_planes_the_fibres_run_as_before():
    result, start = trimmed(parallel()), parallel()[:, :1, :2]
    middle = (result[:, :, 2] > 12) & (result[:, :, 2] < 88)
    assert middle.any(axis=1).all()
    assert_allclose(np.where(middle[:, :, None], result[:, :, :2] - start, 0), 0, atol=1e-9)


def test_no_more_than_the_largest_cut_is_taken_off():
    # An area along nearly the whole rod: its plane would leave nothing.
    long = area(lambda p: (p[:, 2] <= 85) & (p[:, 0] >= 9), 85.0)
    result = trimmed(parallel(), origin=long, largest_cut=0.25)
    for fibre, foot in zip(result, parallel()[:, 0, :2], strict=True):
        middle = fibre[(fibre[:, 2] > 27) & (fibre[:, 2] < 88)]
        assert len(middle) > 5
        assert_allclose(middle[:, :2], np.broadcast_to(foot, (len(middle), 2)), atol=1e-9)


def test_fibres_that_run_from_area_to_area_are_left_as_they_are():
    # Pennate: from the lower half of one side to the upper half of the other, all along the planes' way.
    rng = np.random.default_rng(4)
    turn, z = rng.uniform(-0.5, 0.5, 30), rng.uniform(2, 38, 30)
    foot = np.column_stack([-RADIUS * np.cos(turn), RADIUS * np.sin(turn), z])
    head = np.column_stack([RADIUS * np.cos(turn), RADIUS * np.sin(turn), z + 60])
    lines = foot[:, None] + np.linspace(0, 1, 9)[:, None] * (head - foot)[:, None]
    sides = (
        area(lambda p: (p[:, 0] < -5) & (p[:, 2] <= 40), 40.0),
        area(lambda p: (p[:, 0] > 5) & (p[:, 2] >= 60), 60.0),
    )
    assert_allclose(trimmed(lines, origin=sides[0], insertion=sides[1]), lines, atol=1e-9)


def test_the_ends_stay_on_the_areas_where_these_are_not_in_the_muscle():
    bottom, top = area(**BOTTOM), area(**TOP)
    shorter = [-99, -99, 12], [99, 99, LENGTH - 12]
    result = trimmed(parallel(5), inside=lambda places: into_rod(places).clip(*shorter))
    for end, number in ((bottom, 0), (top, -1)):
        assert distance_to_patch(result[:, number], end).max() < 1e-9
    assert (result[:, 1:-1, 2] >= 12).all()
    assert (result[:, 1:-1, 2] <= LENGTH - 12).all()


@pytest.mark.gap("depth of new fibre ends in a hollow, before the projection", "0.82 mm", "0.7 mm")
def test_new_segments_stay_in_the_muscle_even_beside_a_hollow():
    # Beyond z = 75 the rod is hollow around its axis: a straight cut to the end face would cross it.
    pushed = []

    def out_of_hollow(places):
        radius = np.hypot(*places[:, :2].T)
        hollow = (places[:, 2] > 75) & (places[:, 2] < 95) & (radius < 5)
        moved = into_rod(places)
        moved[hollow, :2] *= (5 / np.maximum(radius[hollow], 1e-9))[:, None]
        pushed.append(np.linalg.norm(moved - places, axis=1).max())
        return moved

    lines = parallel(12, 41, radius=1.0)
    # The fibres go around it, and end too far below the face to be on it.
    lines *= [1, 1, 0.97]
    away = 7.0 * np.clip((lines[:, :, 2] - 62) / 8, 0, 1)
    turn = np.arctan2(lines[:, 0, 1], lines[:, 0, 0])
    lines[:, :, 0] += away * np.cos(turn)[:, None]
    lines[:, :, 1] += away * np.sin(turn)[:, None]
    face = area(lambda p: p[:, 2] >= LENGTH, 60.0)
    result = trimmed(lines, insertion=face, largest_cut=0.5, inside=out_of_hollow).reshape(-1, 3)
    assert max(pushed[:-1]) > 3  # cut where the plane is, the new segments would cross the hollow
    assert pushed[-1] < 0.85  # and the final ones do not
    assert_allclose(out_of_hollow(result), result, atol=1e-9)


def test_more_fibres_than_are_assigned_at_once_all_end_in_places_of_their_own():
    result = trimmed(parallel(n=600, count=5))
    for end in (0, -1):
        assert nearest_other(result[:, end]).min() > 1e-6


def test_degenerate_fibres_give_finite_points():
    lines = parallel(n=5)
    lines[0] = [0, 0, 50]  # no length
    lines[1] = lines[1][:1]  # no length, and on the surface
    lines[2, :, 2] = 3.0  # all of it beyond the plane
    assert np.isfinite(trimmed(lines)).all()


@settings(max_examples=40)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 12))
def test_new_segments_in_a_plane_never_cross(seed, count):
    rng = np.random.default_rng(seed)
    starts = np.column_stack([rng.uniform(-5, 5, count), np.zeros(count), np.zeros(count)])
    places = np.column_stack([rng.uniform(-9, 9, count), np.zeros(count), rng.uniform(1, 20, count)])
    ends = places[assign_positions(starts, places)]

    def side(a, b, c):
        return (b[0] - a[0]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[0] - a[0])

    for i in range(count):
        for j in range(i):
            a, b, c, d = starts[i], ends[i], starts[j], ends[j]
            assert not (side(a, b, c) * side(a, b, d) < -1e-9 and side(c, d, a) * side(c, d, b) < -1e-9)


def test_fibres_that_all_lean_to_one_side_do_not_exchange_their_ends():
    # A sheet whose last section is pinched: every fibre heads for the middle, those of the edge most.
    x = np.linspace(-10.0, 10.0, 9)
    departures, places = (np.column_stack([x, 0 * x, np.full(9, z)]) for z in (0.0, 4.0))
    departures[:, 0] *= 0.1
    assert_array_equal(assign_positions(departures, places), np.arange(9))


def test_fibres_that_reach_the_area_by_a_hook_get_another_end():
    # Up along the rod, back down beside its end and onto the face: on the area, but not as a fibre is.
    lines = parallel()
    hooked = lines.copy()
    hooked[:, -3] = lines[:, -1] - 3 * AXIS
    hooked[:, -2] = lines[:, -1] - 8 * AXIS + [1.0, 0, 0]
    result = trimmed(hooked)
    assert turns_of(result).max() < 60.0
    assert_allclose(distance_to_patch(result[:, -1], area(**TOP)), 0, atol=1e-9)


def distance_to_ray(points, start, ahead):
    t = np.maximum((points - start) @ ahead, 0.0)
    return np.linalg.norm(points - start - t[:, None] * ahead, axis=1)


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_no_point_of_the_triangles_is_closer_to_the_ray(seed):
    rng = np.random.default_rng(seed)
    n = 40  # several leaves of a tree
    corners = rng.normal(size=(n, 3, 3)) + rng.normal(scale=4.0, size=(n, 1, 3))
    start, ahead = rng.normal(size=3), rng.normal(size=3)
    ahead /= np.linalg.norm(ahead)
    tree = triangle_tree(corners.reshape(-1, 3), np.arange(3 * n).reshape(n, 3))
    found = closest_to_ray(start, ahead, tree)
    sampled = np.einsum("mks,msd->mkd", rng.dirichlet([0.6, 0.6, 0.6], (n, 4000)), corners).reshape(-1, 3)
    least = distance_to_ray(sampled, start, ahead).min()
    assert distance_to_ray(found[None], start, ahead)[0] <= least + 1e-9
    assert np.linalg.norm(sampled - found, axis=1).min() < 0.3  # it is on a triangle


def plate(height):
    points = np.array([[-5.0, -5, height], [5, -5, height], [5, 5, height], [-5, 5, height]])
    return EndArea(points, PatchSamples(points, np.array([[0, 1, 2], [0, 2, 3]]), np.arange(4)))


def test_a_fibre_is_cut_at_the_planes_and_goes_on_in_its_own_direction():
    line = np.column_stack([0.1 * np.arange(-10.0, 11.0), np.zeros(21), np.arange(-10.0, 11.0)])
    line[-1] += [3.0, 0, 0]  # beyond the plane, and so gone
    points, offsets = ends_as_printed(
        line, np.array([0, 21]), axis=np.array([0.0, 0, 1]), origin=plate(-8.5), insertion=plate(8.5)
    )
    assert offsets.tolist() == [0, len(points)]
    np.testing.assert_allclose(points[[0, -1], 2], [-8.5, 8.5])
    np.testing.assert_allclose(points[:, 0], 0.1 * points[:, 2], atol=1e-12)


@pytest.mark.parametrize("x", [0.0, 2.0])
def test_parallel_fibres_beside_an_area_end_on_its_nearest_rim(x):
    """Why fibres share the area out by default."""
    line = np.array([[x + 20.0, 1.0, 0.0], [x + 20.0, 1.0, 5.0], [x + 20.0, 1.0, 12.0]])
    points, _ = ends_as_printed(
        line, np.array([0, 3]), axis=np.array([0.0, 0, 1]), origin=plate(-1.0), insertion=plate(8.5)
    )
    np.testing.assert_allclose(points[-1], [5.0, 1.0, 8.5], atol=1e-12)
