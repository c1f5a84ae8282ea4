import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vtkmuscle.core.fibres.measures import (
    TENDON_AREAS,
    AreaProfile,
    along,
    angles_to_inner_sheet,
    area_profile,
    arrangement,
    centroid_path,
    fascicles,
    line_of_action,
    mean_errors,
    physiological_cross_section,
    section_areas,
    segment_errors,
)
from vtkmuscle.core.mesh.polylines import sharp_turns
from vtkmuscle.core.paths.neighbours import path_lengths
from vtkmuscle.phantoms.meshing import box, solid_of_revolution


def arc(radius, turn, n=40):
    t = np.linspace(0, turn, n)
    return radius * np.column_stack([np.cos(t), np.sin(t), 0 * t])


def test_the_centroid_path_of_parallel_arcs_is_the_middle_one():
    lines = [np.add(arc(20.0, 2.0), [0, 0, z]) for z in (-3.0, 0.0, 6.0)]
    path = centroid_path(np.vstack(lines), np.array([0, 40, 80, 120]), 40)
    assert_allclose(path, np.add(arc(20.0, 2.0), [0, 0, 1.0]), atol=0.01)


def test_angles_to_the_line_of_action():
    lines = np.array([[[0, 0, 0], [1, 0, 1]], [[0, 0, 0], [-1, 0, 1]], [[5, 0, 0], [5, 0, 7.0]]])
    direction, angles = line_of_action(lines.reshape(-1, 3), np.array([0, 2, 4, 6]))
    assert_allclose(direction, [0, 0, 1])
    assert_allclose(angles, [45, 45, 0], atol=1e-12)


def test_the_physiological_cross_section_of_a_pennate_block():
    # Fibres of length L at angle alpha in a volume V: V / L, and cos(alpha) of it along the line.
    area, along = physiological_cross_section(96000.0, np.full(7, 60.0), np.full(7, 60.0))
    assert area == pytest.approx(1600.0)
    assert along == pytest.approx(800.0)


def test_section_areas_of_a_box_whichever_way_it_faces():
    points, triangles = box((0, 0, 0), (20.0, 30.0, 50.0), 6.0)
    places = np.array([[10, 15, 17.3], [3.3, 15, 25], [10, 15, 99]])
    normals = np.array([[0, 0, 1.0], [1, 0, 0], [0, 0, 1]])
    assert_allclose(section_areas(points, triangles, places, normals), [600, 1500, 0], atol=1e-9)
    assert_allclose(section_areas(points, triangles[:, ::-1], places, -normals), [600, 1500, 0], atol=1e-9)
    slanted = np.array([[0, np.sin(0.3), np.cos(0.3)]])
    area = section_areas(points, triangles, np.array([[10, 15, 25.0]]), slanted)
    assert_allclose(area, 600 / np.cos(0.3), rtol=1e-9)


def helix(radius, angle, segments):
    turn = np.linspace(0.0, angle, segments + 1)
    return radius * np.column_stack([np.cos(turn), np.sin(turn), 0.1 * turn])


@pytest.mark.parametrize("segments", [8, 15, 16])
def test_segment_errors_bound_what_chords_miss_of_an_arc(segments):
    straight = np.outer(np.linspace(0.0, 1.0, segments + 1), [1.0, 2.0, 2.0])
    lines = np.array([helix(30.0, 1.5, segments), helix(50.0, 0.4, segments), straight])
    missed = np.sqrt(1.01) * np.array([45.0, 20.0]) - path_lengths(lines[:2])
    errors = segment_errors(lines)
    assert (missed > 0.0).all()
    assert (missed <= errors[:2]).all()
    assert (errors[:2] <= 4.0 * missed).all()
    assert errors[2] == pytest.approx(0.0, abs=1e-12)


def test_errors_of_means_are_the_root_of_the_sum_of_squares_of_their_parts(rng):
    samples = rng.normal(scale=3.0, size=(4000, 16))
    known = {"numerical": np.full(4000, 0.5), "bow": np.linspace(0.0, 2.0, 4000)}
    errors = mean_errors(samples, np.full(4000, 1.2), **known)
    # 95 % of the means are within the sampling error of the true mean, 0.
    assert np.mean(np.abs(samples.mean(axis=1)) <= errors["sampling"]) == pytest.approx(0.95, abs=0.025)
    parts = [errors[part] for part in ("model", "sampling", *known)]
    assert_allclose(errors["total"], np.linalg.norm(parts, axis=0))
    assert_allclose(mean_errors(samples, np.full(4000, 0.75), **known)["model"], 2.0 * errors["model"])
    assert np.isnan(mean_errors(np.ones((5, 1)), np.ones(5))["total"]).all()


#: A sheet of 10 x 4 fibres, 2 mm from each other and 60 mm long, in the middle of what it fills.
X, Y, Z = np.arange(10.0) * 2.0, np.arange(4.0) * 2.0, np.linspace(0.0, 60.0, 31)


def sheet():
    x, y, z = np.meshgrid(X, Y, Z, indexing="ij")
    return np.stack([x, y, z], axis=-1).reshape(40, 31, 3)


def inside(rng, low=(-1.0, -1.0, 0.0), high=(19.0, 7.0, 60.0)):
    return rng.uniform(low, high, (4000, 3))


def found(lines, samples):
    offsets, volume = np.arange(len(lines) + 1) * lines.shape[1], np.prod(np.ptp(samples, axis=0))
    return arrangement(lines.reshape(-1, 3), offsets, samples, volume)


def test_straight_fibres_neither_cross_nor_turn_and_leave_nothing_bare(rng):
    good = found(sheet(), inside(rng))
    assert (good.crossing, good.hooked, good.bare) == (0.0, 0.0, 0.0)
    assert good.turning == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("end", ["origin", "insertion"])
def test_fibres_that_change_over_to_the_other_edge_cross(rng, end):
    lines = sheet()
    share = np.clip((Z - 54.0) / 6.0, 0.0, 1.0)
    lines[..., 0] += share * (18.0 - 2.0 * lines[..., 0])
    lines[..., 1] += share * (6.0 - 2.0 * lines[..., 1])
    if end == "origin":
        lines = lines[:, ::-1]
    assert found(lines, inside(rng)).crossing > 0.9


def test_fibres_that_run_together_or_wind_do_not_cross(rng):
    lines = sheet() - [9.0, 3.0, 0.0]
    tip = lines.copy()
    tip[..., :2] *= (1.0 - 0.95 * Z / 60.0)[:, None]
    assert found(tip, inside(rng)).crossing < 0.02
    angle = np.pi * Z / 60.0
    x, y = lines[..., 0].copy(), lines[..., 1].copy()
    lines[..., 0] = np.cos(angle) * x - np.sin(angle) * y
    lines[..., 1] = np.sin(angle) * x + np.cos(angle) * y
    assert found(lines, inside(rng)).crossing == 0.0


def test_hooks_and_turns_are_counted(rng):
    lines = sheet()
    lines[:10, -4:] = lines[:10, -5, None] - np.arange(1.0, 5.0)[:, None] * [0.5, 0.0, 2.0]
    assert found(lines, inside(rng)).hooked == 0.25
    bent = np.where(np.arange(31)[:, None] < 15, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]).cumsum(axis=0)
    assert found(bent + sheet()[:, :1], inside(rng)).hooked == 0.0  # the muscle's course
    turn = np.pi * Z / 60.0
    bend = np.column_stack([30.0 * np.cos(turn), 0 * turn, 30.0 * np.sin(turn)])
    arcs = bend + np.arange(6.0)[:, None, None] * [0.0, 2.0, 0.0]
    assert found(arcs, inside(rng)).turning == pytest.approx(180.0 * 29 / 30, rel=1e-6)


def test_the_grain_of_fibres_of_many_points_is_no_turn(rng):
    fine = np.linspace(sheet()[:, 0], sheet()[:, -1], 1000, axis=1)
    assert found(fine + rng.normal(0.0, 0.01, fine.shape), inside(rng)).turning < 60.0


def test_fibres_much_longer_than_their_spacing_leave_nothing_bare_between_stations(rng):
    assert found((sheet() * [1.0, 1.0, 10.0]), inside(rng, high=(19.0, 7.0, 600.0))).bare == 0.0


def test_a_half_without_fibres_is_bare(rng):
    assert found(sheet(), inside(rng, high=(39.0, 7.0, 60.0))).bare == pytest.approx(0.45, abs=0.03)


def test_a_path_that_hooks_turns_sharply_and_an_arc_does_not():
    turn = np.pi * np.linspace(0.0, 1.0, 31)
    arc = 60.0 * np.column_stack([np.cos(turn), 0.0 * turn, np.sin(turn)])
    hook = np.vstack(
        [np.linspace([0.0, 0, 0], [0, 0, 80], 21)[:-1], np.linspace([0.0, 0, 80], [40, 0, 80], 11)]
    )
    for size in (1 / 30, 1.0, 30.0):
        path, position, reach = sharp_turns(size * np.array([arc, hook]))
        assert set(path) == {1}
        assert np.linalg.norm(position - size * np.array([0.0, 0.0, 80.0]), axis=1).max() < 12.0 * size
        assert reach == pytest.approx(6.0 * size)


#: A belly of radius 12 mm and 80 mm long, with tendons of radius 2 mm, 60 mm and 40 mm long.
BELLY, TENDON, LONG = 12.0, 2.0, (60.0, 80.0, 40.0)


def bent(places):
    """Return places of a straight muscle along z, 180 mm, bent round an axis 100 mm aside, by 1.8 rad."""
    angle, off = places[..., 2] / 100.0, 100.0 + places[..., 0]
    return np.stack([off * np.cos(angle) - 100.0, places[..., 1], off * np.sin(angle)], axis=-1)


def spindle(rng, count=30000):
    """Return the surface, samples, volumes of the parts, and 12 fibres through belly and tendons."""
    heights = np.concatenate([np.linspace(a, b, 31) for a, b in ((0, 60), (60.01, 140), (140.01, 180))])
    around = solid_of_revolution(heights, np.repeat([TENDON, BELLY, TENDON], 31), 24)
    volumes = np.pi * np.array([TENDON, BELLY, TENDON]) ** 2 * LONG
    part = rng.choice(3, count, p=volumes / volumes.sum())
    z = np.cumsum([0.0, *LONG])[part] + rng.uniform(size=count) * np.array(LONG)[part]
    radius = np.array([TENDON, BELLY, TENDON])[part] * np.sqrt(rng.uniform(size=count))
    turn = rng.uniform(0.0, 2.0 * np.pi, count)
    samples = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])
    heights = np.linspace(0.0, 180.0, 37)
    wide = np.interp(heights, [0.0, 60.0, 140.0, 180.0], [0.1, 0.6, 0.6, 0.1]) * BELLY
    turns = 2.0 * np.pi * np.arange(12) / 12
    fibres = np.array([np.column_stack([wide * np.cos(t), wide * np.sin(t), heights]) for t in turns])
    return around, samples, volumes, fibres.reshape(-1, 3), np.arange(13) * 37


@pytest.mark.parametrize("shape", [lambda p: p, bent], ids=["straight", "bent"])
def test_tendons_are_told_from_the_belly(rng, shape):
    (surface, triangles), samples, volumes, points, offsets = spindle(rng)
    surface, samples, points = shape(surface), shape(samples), shape(points)
    profile = area_profile(surface, triangles, samples, points, offsets)
    low, high = profile.muscle_between(TENDON_AREAS[0])
    assert high - low == pytest.approx(80.0, abs=5.0)
    assert profile.areas.max() == pytest.approx(np.pi * BELLY**2, rel=0.1)
    (found,) = fascicles(profile, volumes.sum(), points, offsets, shares=[TENDON_AREAS[0]])
    assert found.volume == pytest.approx(volumes[1], rel=0.02)
    assert found.lengths.mean() == pytest.approx(80.0, abs=5.0)


def test_the_volume_between_two_arcs_counts_parts_of_pieces():
    profile = AreaProfile(np.zeros((2, 3)), np.array([0.5, 1.5, 2.5, 3.5]), np.array([1.0, 2.0, 3.0, 4.0]))
    assert profile.volume_share(0.0, 4.0) == pytest.approx(1.0)
    assert profile.volume_share(0.25, 2.5) == pytest.approx((0.75 + 2.0 + 1.5) / 10.0)
    assert profile.volume_share(2.5, 9.0) == pytest.approx((1.5 + 4.0) / 10.0)


def test_a_curve_goes_on_straight_beyond_its_ends():
    curve = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 10.0], [10.0, 0.0, 10.0]])
    arcs, directions = along(curve, np.array([[1.0, 0.0, -3.0], [2.0, 0.0, 4.0], [14.0, 1.0, 9.0]]))
    np.testing.assert_allclose(arcs, [-3.0, 4.0, 24.0])
    np.testing.assert_allclose(directions, [[0, 0, 1], [0, 0, 1], [1, 0, 0]])


@pytest.mark.parametrize("angle", [0.0, 20.0, 90.0])
def test_fibre_ends_off_the_surface_span_a_sheet_to_which_fibres_have_angles(angle):
    turn, (x, y) = Rotation.from_euler("xyz", [20.0, 30.0, 40.0], degrees=True), np.mgrid[:6.0, :5.0]
    ends = turn.apply(np.column_stack([x.ravel(), y.ravel(), np.zeros(30)]))
    run = turn.apply([np.cos(np.radians(angle)), 0.0, np.sin(np.radians(angle))])
    within = (x.ravel() > 0) | (y.ravel() == 2.0)  # one side is the sheet's rim, on the surface
    inner, angles = angles_to_inner_sheet(ends, np.tile(run, (30, 1)), within)
    assert inner[x.ravel() > 0].all()
    assert_allclose(angles, angle, atol=1e-6)
    zigzag = ends[:5] + 0.05 * turn.apply([(1, 0, 0), (0, 0, 1), (-1, 0, -1), (1, 0, 0), (0, 0, 1)])
    for row in (ends[:2], ends[:3], ends[::5], ends[[4, 4, 4]], zigzag):
        assert not angles_to_inner_sheet(row, np.tile(run, (len(row), 1)), np.ones(len(row), bool))[0].any()
