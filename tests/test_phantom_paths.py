"""Phantoms with known paths: lengths against an independent taut string, moment arms against lengths."""

import numpy as np
import pytest
from phantom_oracles import moved_centres, slope, taut_length
from phantoms import (
    flexor_over_brim,
    lifting_strap,
    slivered_tendon,
    spindle_over_ball,
    strap_over_two_joints,
    tendon_through_ring,
)
from phantoms.planar import evenly
from phantoms.taut_string import String

from vtkmuscle import Scene
from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.paths.via_rings import passes_through, via_ring, within_ring
from vtkmuscle.data.arrays import cell_array, points_of, triangles_of
from vtkmuscle.data.attachments import attachments_of
from vtkmuscle.filters import FibreMetrics
from vtkmuscle.pipelines import decompose


@pytest.mark.parametrize(
    ("make", "at_rest"),
    [
        (lifting_strap, (0.0,)),
        (flexor_over_brim, (0.0,)),
        (strap_over_two_joints, (0.0, 0.0)),
        (spindle_over_ball, (0.0, 0.0)),
        (slivered_tendon, (0.0,)),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_fibres_at_rest_are_as_long_as_is_known(make, at_rest):
    phantom = make()
    ((name, muscle),) = phantom.muscles.items()
    # Enough segments to go round the bends; fibres beside the middle of a bend are longer or shorter.
    fibres = decompose(muscle, phantom.attachments[name], method="harmonic", resolution=48)
    lengths = cell_array(FibreMetrics()(fibres, muscle), "Length", name)
    assert lengths.mean() == pytest.approx(phantom.known["length"](*at_rest), rel=0.01)


# -------------------------------------------------------------------- a string past a circle


def test_a_string_is_as_long_as_the_hull_of_its_circle_says(rng):
    wraps = []
    for _ in range(60):
        ends = np.array([[0.0, 6.0], [0.0, -6.0]]) + rng.uniform(-4.0, 4.0, (2, 2))
        string = String(*ends, np.zeros(2), 1.5, 1)
        taut = taut_length(*ends, [((0.0, 0.0), 1.5)], outward=(-1.0, 0.0))
        assert string.length == pytest.approx(taut, rel=1e-6)
        wraps.append(string.wrap)
    assert 10 < np.count_nonzero(wraps) < 50


def test_a_string_pulls_along_itself(rng):
    for _ in range(20):
        ends = np.array([[0.0, 6.0], [0.0, -6.0]]) + rng.uniform(-4.0, 4.0, (2, 2))
        string = String(*ends, np.zeros(2), 1.5, 1)
        for axis in np.eye(2):
            longer, shorter = (
                String(ends[0], ends[1] + s * axis, np.zeros(2), 1.5, 1) for s in (1e-5, -1e-5)
            )
            assert -string.pull @ axis == pytest.approx((longer.length - shorter.length) / 2e-5, abs=1e-4)


def test_points_of_a_string_are_as_long_as_it_is_and_stay_out_of_the_circle():
    string = String(np.array([-3.0, 5.0]), np.array([4.0, -5.0]), np.zeros(2), 2.0, 1)
    points = string.points(0.01)
    assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(string.length, rel=1e-5)
    assert np.linalg.norm(points, axis=1).min() == pytest.approx(2.0, abs=1e-4)
    np.testing.assert_allclose(np.linalg.norm(np.diff(points, axis=0), axis=1), 0.01, rtol=0.01)


def test_evenly_keeps_the_ends():
    chain = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 5.0]])
    np.testing.assert_array_equal(evenly(chain, 0.7)[[0, -1]], chain[[0, -1]])


# -------------------------------------------------------------------- a strap that lifts off


@pytest.mark.parametrize("angle", [0.0, 12.0, 29.0, 30.0, 33.0, 50.0, 70.0])
def test_lifting_strap_is_as_long_as_a_string_past_its_roller(angle):
    phantom = lifting_strap()
    start, end = moved_centres(phantom, angle)
    taut = taut_length(start, end, [((0.0, 0.0), 25.0)], outward=(-1.0, 0.0))
    assert phantom.known["length"](angle) == pytest.approx(taut, rel=1e-6)
    if angle > phantom.known["lift_off"]:
        assert taut == pytest.approx(np.linalg.norm(end - start), rel=1e-12)
    elif angle < phantom.known["lift_off"]:
        assert taut > np.linalg.norm(end - start) + 1e-4


@pytest.mark.parametrize("depth", [-5.0, 0.0, 3.0])
def test_lifting_straps_moment_arm_is_the_derivative_of_its_length(depth):
    known = lifting_strap().known
    for angle in (0.0, 15.0, 29.0, 31.0, 45.0, 70.0):
        arm = known["moment_arm"](angle, depth)
        assert arm == pytest.approx(-slope(lambda q: known["length"](q, depth), angle), abs=1e-5)
        if angle <= known["lift_off"]:
            assert arm == pytest.approx(25.0 + depth, rel=1e-12)
        else:
            assert arm > 25.0 + depth + 0.5


def test_lifting_strap_lies_on_its_roller_and_nowhere_else():
    points = points_of(lifting_strap().muscles["strap"])
    touching = points[np.hypot(points[:, 1], points[:, 2]) < 20.05]
    turn = np.degrees(np.arctan2(-touching[:, 2], -touching[:, 1]))
    assert len(touching) > 30
    assert turn.min() > -5.0
    assert turn.max() < 35.0
    assert np.hypot(points[:, 1], points[:, 2]).min() > 19.95


# -------------------------------------------------------------------- over a brim, in a groove


@pytest.mark.parametrize("angle", [0.0, 25.0, 50.0, 80.0])
def test_flexor_is_as_long_as_a_string_over_its_brim(angle):
    phantom = flexor_over_brim()
    start, end = moved_centres(phantom, angle)
    taut = taut_length(start, end, [((-16.0, 14.0), 15.0)], outward=(-1.0, 0.0))
    assert phantom.known["length"](angle) == pytest.approx(taut, rel=1e-6)


def test_flexors_moment_arms_are_derivatives_of_lengths():
    phantom = flexor_over_brim()
    known = phantom.known

    def straight(angle):
        start, end = moved_centres(phantom, angle)
        return np.linalg.norm(end - start)

    for angle in (0.0, 20.0, 47.0, 80.0):
        assert known["moment_arm"](angle) == pytest.approx(-slope(known["length"], angle), abs=1e-5)
    for angle in (13.0, 46.0):  # between rows the motion is that of the hinge, as well
        assert known["straight_moment_arm"](angle) == pytest.approx(-slope(straight, angle), abs=1e-5)
    assert [known["moment_arm"](angle) > 15.0 for angle in (0.0, 40.0)] == [True, True]
    assert [known["straight_moment_arm"](angle) < 0.0 for angle in (0.0, 40.0)] == [True, True]


def relaxed(start, end, groove, rounds=6000, count=61):
    """Return the length of a string without friction, as far outside the brim as the muscle's radius says.

    Pulled taut by averages of neighbours and pushed out along the ground's gradient, from 2 mm to the side.
    """
    line = np.linspace(0.0, 1.0, count)
    corner = np.array([-60.0, 20.0])  # well in front of the brim
    first, second = (2.0 * line[:, None], 2.0 * line[:, None] - 1.0)
    way = np.where(first < 1.0, start + first * (corner - start), corner + second * (end - corner))
    points = np.column_stack([2.0 * np.sin(np.pi * line), way])
    for _ in range(rounds):
        points[1:-1] = 0.25 * points[:-2] + 0.5 * points[1:-1] + 0.25 * points[2:]
        x, away = points[1:-1, 0], points[1:-1, 1:] - [-16.0, 14.0]
        distance = np.linalg.norm(away, axis=1)
        value = distance - 15.0 - groove * np.sin(np.pi * x / 32.0) ** 2
        slope = np.column_stack([-groove * np.pi / 32.0 * np.sin(np.pi * x / 16.0), away / distance[:, None]])
        inside = (value < 0.0) & (np.abs(x) < 19.0)
        points[1:-1] -= np.where(inside, value / (slope**2).sum(axis=1), 0.0)[:, None] * slope
    return np.linalg.norm(np.diff(points, axis=0), axis=1).sum()


@pytest.mark.parametrize(("groove", "stays"), [(8.0, True), (-5.0, False)])
def test_the_groove_holds_a_string_without_friction_and_the_ridge_does_not(groove, stays):
    phantom = flexor_over_brim(groove=groove)
    known = phantom.known["length"](0.0)
    length = relaxed(*moved_centres(phantom, 0.0), groove)
    assert (length == pytest.approx(known, rel=2e-3)) == stays
    assert stays or length < known - 3.0


@pytest.mark.parametrize("groove", [8.0, 0.0, -5.0])
def test_the_brim_has_its_profile(groove):
    phantom = flexor_over_brim(groove=groove)
    bone = points_of(phantom.bones.GetBlock(0))
    away = bone[:, 1:] - [-16.0, 14.0]
    radius = np.linalg.norm(away, axis=1)
    front = (np.abs(bone[:, 0]) < 14.0) & (away[:, 0] < -0.3 * radius) & (radius < 20.0)
    assert np.count_nonzero(front) > 80
    expected = 9.0 + groove * np.sin(np.pi * bone[front, 0] / 32.0) ** 2
    np.testing.assert_allclose(radius[front], expected, atol=0.05)


def test_a_groove_that_the_muscle_does_not_fit_in_is_refused():
    with pytest.raises(ValueError, match=r"groove is 9.0.*-5 to 8 mm"):
        flexor_over_brim(groove=9.0)


# -------------------------------------------------------------------- a tendon of slivers


def aspect_ratios(points, triangles):
    """Return the longest edge of each triangle by its least height."""
    corners = points[triangles]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    return edges.max(axis=1) ** 2 / (2.0 * areas)


def test_triangles_of_the_tendon_are_slivers_and_those_of_the_belly_are_not():
    phantom = slivered_tendon()
    points = points_of(phantom.muscles["muscle"])
    triangles = triangles_of(phantom.muscles["muscle"], "test")
    assert 1500 <= len(triangles) <= 4000
    low, high = (points[triangles][..., 2].min(axis=1), points[triangles][..., 2].max(axis=1))
    tendon = (high <= phantom.known["tendon_start"]) & (low < high)
    ratios = aspect_ratios(points, triangles)
    assert 10.0 < np.percentile(ratios[tendon], 95) < 20.0
    assert ratios[tendon].min() > 10.0
    assert np.median(ratios[low > phantom.known["tendon_start"] + 30.0]) < 2.5


@pytest.mark.parametrize("pull", [0.0, 5.0, 50.0, 100.0])
def test_slivered_tendon_is_as_long_as_a_string_round_its_edge(pull):
    phantom = slivered_tendon(pulls=[0.0, 5.0, 50.0, 100.0])
    start, end = moved_centres(phantom, pull)
    taut = taut_length(start, end, [((0.0, 0.0), 18.0)], outward=(-1.0, 0.0))
    assert phantom.known["length"](pull) == pytest.approx(taut, rel=1e-6)
    if pull == 0.0:
        np.testing.assert_allclose(end, [-18.0, -40.0], atol=1e-12)
    if pull == 100.0:
        np.testing.assert_allclose(end, [140.0 - 9.0 * np.pi, -18.0], atol=1e-9)


def test_slivered_tendon_has_its_volume_and_the_steps_of_the_caller():
    phantom = slivered_tendon(pulls=[0.0, 1.0, 40.0])
    muscle = phantom.muscles["muscle"]
    volume = survey(points_of(muscle), triangles_of(muscle, "test")).volume
    assert phantom.known["volume"] == pytest.approx(volume, rel=1e-12)
    np.testing.assert_array_equal(phantom.motion.times, [0.0, 1.0, 40.0])
    with pytest.raises(ValueError, match=r"a pull is 101 mm.*0 to 100"):
        slivered_tendon(pulls=[0.0, 101.0])


# -------------------------------------------------------------------- through a ring


@pytest.mark.parametrize("clearance", [0.0, 3.5])
@pytest.mark.parametrize("angle", [0.0, 12.0, 60.0])
def test_tendon_is_as_long_as_the_shortest_way_through_its_ring(angle, clearance):
    phantom = tendon_through_ring()
    origin, insertion, ring = attachments_of(phantom.attachments["muscle"], "test")
    assert (ring.role, ring.bone, len(ring.landmarks)) == ("via", "proximal", 8)
    start = origin.landmarks.mean(axis=0)
    end = apply_transform(phantom.motion.at(angle)["distal"], insertion.landmarks).mean(axis=0)
    # Over all places of the octagon, by a fine net of it, whose sides are moved in by the clearance.
    centre = ring.landmarks.mean(axis=0)
    part = np.linspace(0.0, 1.0, 401)[:, None, None]
    corners = centre + (1.0 - clearance / 6.0) * (ring.landmarks - centre)
    rim = (corners + part * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 3)
    net = (centre + np.linspace(0.0, 1.0, 301)[:, None, None] * (rim - centre)).reshape(-1, 3)
    shortest = (np.linalg.norm(net - start, axis=1) + np.linalg.norm(net - end, axis=1)).min()
    assert phantom.known["length"](angle, clearance) == pytest.approx(shortest, abs=1e-3)


def test_tendons_moment_arms_are_derivatives_of_lengths():
    known = tendon_through_ring().known
    for clearance in (0.0, 3.5):
        for angle in (2.0, 25.0, 60.0):
            by_length = -slope(lambda q, c=clearance: known["length"](q, c), angle)
            assert known["moment_arm"](angle, clearance) == pytest.approx(by_length, abs=1e-5)
    assert known["moment_arm"](0.0) == known["straight_moment_arm"](0.0) == pytest.approx(32.0)
    # Without the ring it bowstrings.
    assert known["straight_moment_arm"](60.0) > 1.5 * known["moment_arm"](60.0)
    with pytest.raises(ValueError, match=r"clearance is 7.0.*0 to 6 mm"):
        known["length"](10.0, 7.0)


def test_the_tendon_passes_through_its_ring_at_rest():
    phantom = tendon_through_ring()
    muscle = phantom.muscles["muscle"]
    _, _, area = attachments_of(phantom.attachments["muscle"], "test")
    ring = via_ring(area.landmarks)
    points = points_of(muscle)
    assert passes_through(ring, points, triangles_of(muscle, "test"))
    near = np.abs(points[:, 2] - ring.centre[2]) < 2.0
    assert np.count_nonzero(near) > 20
    assert within_ring(ring, points[near]).all()
    radii = np.hypot(points[near, 0], points[near, 1] + 32.0)
    np.testing.assert_allclose(radii, phantom.known["tendon_radius"], atol=0.3)
    assert Scene.from_phantom(phantom).muscles["muscle"].attachments[2].role == "via"
