import numpy as np
import pytest
from bent_muscle import bent_tube, half_circle, letter_s
from oracles import igl
from shapes import closed_surface, turns_of

from vtkmuscle.core.morphing import isolines
from vtkmuscle.core.morphing.isolines import IsolineCourse, attachment_field, morph_by_isolines
from vtkmuscle.core.morphing.slices import Slicing, morph_by_planes
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.template import TEMPLATES, centroid_axis, fit_box, sobol_points
from vtkmuscle.phantoms.meshing import box

RADIUS = 12.0
BOTTOM = np.array([(0.0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
SETTINGS = {"slice_tolerance": 0.1, "continuity": 0.2}


def fitted(points, origin, insertion, n_fibres=40, resolution=15, kind="parallel"):
    """Return the transform and the fitted fibres, (n, m, 3)."""
    areas, ends = (BOTTOM, BOTTOM + np.array([0.0, 0, 1])), (points[origin], points[insertion])
    fit = fit_box(points, centroid_axis(*ends), landmarks=ends, areas=areas, angle_step=5.0)
    cube = TEMPLATES[kind].fibres(*sobol_points(n_fibres).T, np.linspace(0, 1, resolution + 1))
    return fit.transform, apply_transform(fit.transform, cube.reshape(-1, 3)).reshape(cube.shape)


def by_isolines(cube, transform, surface, field, **settings):
    slicing = Slicing(**(SETTINGS | settings))
    course = IsolineCourse(closed_surface(*surface), field)
    return morph_by_isolines(cube.reshape(-1, 3), transform, course, slicing)


def morphed(tube, **settings):
    """Return the transform, the fitted and the morphed fibres of a tube."""
    points, triangles, origin, insertion = tube
    transform, cube = fitted(points, origin, insertion, **settings)
    field = attachment_field(points, triangles, origin, insertion)
    return (
        transform,
        cube,
        by_isolines(cube, transform, (points, triangles), field).points.reshape(cube.shape),
    )


def by_planes(cube, transform, surface, **settings):
    slicing = Slicing(**(SETTINGS | settings))
    return morph_by_planes(cube.reshape(-1, 3), transform, closed_surface(*surface), slicing)


def lengths(fibres):
    return np.linalg.norm(np.diff(fibres, axis=1), axis=2).sum(axis=1)


@pytest.fixture(scope="module")
def half_turn():
    return bent_tube(half_circle(), RADIUS)


@pytest.fixture(scope="module")
def double_bend():
    return bent_tube(letter_s(), RADIUS)


def test_fibres_of_a_muscle_bent_by_180_degrees_have_their_known_lengths(half_turn):
    transform, cube, fibres = morphed(half_turn)
    from_axis = np.hypot(fibres[..., 0], fibres[..., 2])
    assert np.ptp(from_axis, axis=1).max() < 0.1 * RADIUS
    assert np.ptp(fibres[..., 1], axis=1).max() < 0.1 * RADIUS
    assert np.abs(lengths(fibres) / (np.pi * from_axis.mean(axis=1)) - 1).max() < 0.01
    assert np.ptp(from_axis.mean(axis=1)) > 1.5 * RADIUS  # they fill the muscle
    assert turns_of(fibres).max() < 20
    angles = np.arctan2(fibres[..., 2], fibres[..., 0])
    assert np.abs(np.abs(angles) - np.linspace(0, np.pi, 16)).max() < 0.05  # and are evenly divided
    planes = by_planes(cube, transform, half_turn[:2])
    assert not planes.suits
    assert np.ptp(np.hypot(*planes.points.reshape(cube.shape)[..., [0, 2]].T), axis=0).max() > RADIUS


def test_fibres_of_a_muscle_bent_in_an_s_have_their_known_lengths(double_bend):
    transform, cube, fibres = morphed(double_bend, resolution=30)
    outward = np.hypot(fibres[..., 0] - 50 * np.where(fibres[..., 0] < 0, -1.0, 1.0), fibres[..., 2]) - 50
    halves = [outward[:, :14].mean(axis=1), outward[:, 17:].mean(axis=1)]
    # What is outside in one bend is inside in the other: all fibres are equally long.
    assert np.abs(halves[0] + halves[1]).max() < 0.2 * RADIUS
    assert np.abs(lengths(fibres) / (np.pi * (100 + halves[0] + halves[1])) - 1).max() < 0.02
    assert turns_of(fibres).max() < 30
    assert not by_planes(cube, transform, double_bend[:2]).suits


def test_fibres_end_on_the_areas_and_are_inside(half_turn):
    points, triangles, origin, insertion = half_turn
    *_, fibres = morphed(half_turn)
    for end, area in ((0, origin), (-1, insertion)):
        disc = triangles[np.isin(triangles, area).all(axis=1)]
        assert igl.point_mesh_squared_distance(fibres[:, end], points, disc)[0].max() < 1e-18
    assert (fibres[:, 0, 0] > 0).all()
    assert (fibres[:, -1, 0] < 0).all()
    assert (igl.winding_number(points, triangles, fibres[:, 1:-1].reshape(-1, 3)) > 0.5).all()


def test_neighbours_stay_neighbours_at_every_isoline(double_bend):
    *_, fibres = morphed(double_bend, n_fibres=64)
    r, s = sobol_points(64).T
    apart = np.hypot(r[:, None] - r, s[:, None] - s)
    close = np.argwhere((apart < 0.2) & (apart > 0))
    for level in range(1, 15):
        distances = np.linalg.norm(fibres[close[:, 0], level] - fibres[close[:, 1], level], axis=1)
        assert distances.max() < 0.8 * RADIUS


def test_rounding_behind_an_area_does_not_move_the_isolines(half_turn, rng):
    points, triangles, _, _ = half_turn
    field = np.clip((points[:, 0] - points[:, 0].min()) / np.ptp(points[:, 0]) * 1.5, 0.0, 1.0)
    rounded = np.where(field == 1.0, 1.0 - 1e-15 * rng.random(len(field)), field)
    distances = [isolines.isoline_distances(points, triangles, each)[1] for each in (field, rounded)]
    assert np.allclose(*distances, rtol=1e-9)


def test_overlapping_or_missing_areas_are_named(half_turn):
    points, triangles, origin, insertion = half_turn
    with pytest.raises(ValueError, match="overlap: 1 point"):
        attachment_field(points, triangles, origin, np.append(insertion, origin[0]))
    with pytest.raises(ValueError, match="no point of the muscle is in the insertion area"):
        attachment_field(points, triangles, origin, np.zeros(0, dtype=np.int64))


def test_areas_on_two_separate_parts_are_refused(half_turn):
    points, triangles, origin, insertion = half_turn
    n = len(points)
    twice, both = np.vstack([points, points + np.array([0.0, 100, 0])]), np.vstack([triangles, triangles + n])
    with pytest.raises(ValueError, match="no connected part"):
        attachment_field(twice, both, origin, np.arange(n, 2 * n))
    box_points, box_triangles = box((0, 0, 0), (20, 20, 100), 10.0)  # its constants differ by rounding
    m, z = len(box_points), box_points[:, 2]
    boxes = np.vstack([box_points, box_points + 50.0]), np.vstack([box_triangles, box_triangles + m])
    with pytest.raises(ValueError, match="no connected part"):
        attachment_field(*boxes, np.flatnonzero(z == 0.0), m + np.flatnonzero(z == 100.0))
    # A second part without areas does no harm.
    field = attachment_field(twice, both, origin, insertion)
    transform, cube = fitted(points, origin, insertion)
    one = by_isolines(cube, transform, (points, triangles), field[:n]).points
    assert np.allclose(one, by_isolines(cube, transform, (twice, both), field).points)
