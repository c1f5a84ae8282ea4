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
from phantoms.taut_string import String

from vtkmuscle import Scene
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


# -------------------------------------------------------------------- each phantom

PULLS = (0.0, 5.0, 50.0, 100.0)


@pytest.mark.parametrize(
    ("phantom", "centre", "radius", "times"),
    [
        (lifting_strap(), (0.0, 0.0), 25.0, (0.0, 12.0, 29.0, 30.0, 33.0, 50.0, 70.0)),
        (flexor_over_brim(), (-16.0, 14.0), 15.0, (0.0, 25.0, 50.0, 80.0)),
        (slivered_tendon(pulls=PULLS), (0.0, 0.0), 18.0, PULLS),
    ],
    ids=["over a roller", "over a brim, in a groove", "round an edge"],
)
def test_a_muscle_is_as_long_as_a_string_past_its_circle(phantom, centre, radius, times):
    for time in times:
        start, end = moved_centres(phantom, time)
        taut = taut_length(start, end, [(centre, radius)], outward=(-1.0, 0.0))
        assert phantom.known["length"](time) == pytest.approx(taut, rel=1e-6)


@pytest.mark.parametrize("angle", [0.0, 12.0, 29.0, 33.0, 50.0, 70.0])
def test_the_lifting_strap_is_straight_from_its_lift_off_on(angle):
    phantom = lifting_strap()
    start, end = moved_centres(phantom, angle)
    longer = phantom.known["length"](angle) - np.linalg.norm(end - start)
    assert longer == pytest.approx(0.0, abs=1e-9) if angle > phantom.known["lift_off"] else longer > 1e-4


def test_the_slivered_tendon_is_pulled_round_its_edge():
    phantom = slivered_tendon(pulls=PULLS)
    for pull, end in ((0.0, [-18.0, -40.0]), (100.0, [140.0 - 9.0 * np.pi, -18.0])):
        np.testing.assert_allclose(moved_centres(phantom, pull)[1], end, atol=1e-9)


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
