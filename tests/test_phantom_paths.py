"""Phantoms with known paths: lengths against an independent taut string, moment arms against lengths."""

import numpy as np
import phantoms
import pytest
from phantoms.planar import flexed
from scipy.optimize import minimize_scalar
from scipy.spatial import ConvexHull

from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.paths.via_rings import passes_through, via_ring
from vtkmuscle.data.arrays import points_of, triangles_of
from vtkmuscle.data.attachments import attachments_of

#: Poses (upper, lower) of the strap over two joints, and (flexion, abduction) of the spindle over a ball.
TWO_JOINTS = [(0.0, 0.0), (60.0, -20.0), (50.0, 60.0), (-40.0, 30.0), (20.0, 90.0), (-10.0, -20.0)]
BALL = [(0.0, 0.0), (35.0, -20.0), (60.0, 20.0), (-10.0, 7.0)]
PULLS = (0.0, 5.0, 50.0, 100.0)


def moved_ends(phantom, time):
    """Return the centres of the origin and the insertion landmarks at a time, origin first."""
    (areas,) = phantom.attachments.values()
    transforms = phantom.motion.at(time)
    ends = [area for area in attachments_of(areas, "test") if area.role != "via"]
    return [apply_transform(transforms.get(a.bone, np.eye(4)), a.landmarks).mean(axis=0) for a in ends]


def taut_length(start, end, circles, outward):
    """Return the length of a string from start to end (2,), held by circles (centre, radius).

    The string is a part of the boundary of the convex hull of its ends and the circles; the other part, less
    far ``outward``, closes the boundary.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, 20000, endpoint=False)
    rim = np.column_stack([np.cos(turn), np.sin(turn)])
    points = np.vstack([start, end, *(np.asarray(centre) + radius * rim for centre, radius in circles)])
    order = ConvexHull(points).vertices.tolist()
    order = order[order.index(0) :] + order[: order.index(0)]
    last = order.index(1)
    ways = [points[order[: last + 1]], points[[*order[last:], 0]]]
    way = max(ways, key=lambda way: (way @ outward).mean())
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


def over_two_joints(pose):
    """Return the phantom, its known length and the rollers' middle circles in a pose."""
    phantom = phantoms.strap_over_two_joints(coordinates=[pose])
    lower = phantom.motion.at(0.0)["middle"] @ [0.0, *flexed((-8.0, -100.0), -60.0), 1.0]
    return phantom, 0.0, phantom.known["length"](*pose), [((0.0, 0.0), 26.0), (lower[1:3], 18.0)]


def held(phantom, circle, times):
    return [(phantom, time, phantom.known["length"](time), [circle]) for time in times]


STRINGS = {
    "wound": held(phantoms.wrapping_cylinder(), ((0.0, 0.0), 30.0), (-79.0, -60.0, 0.0, 40.0, 80.0)),
    "over a roller": held(phantoms.lifting_strap(), ((0.0, 0.0), 25.0), (0.0, 12.0, 29.0, 30.0)),
    "over a brim": held(phantoms.flexor_over_brim(), ((-16.0, 14.0), 15.0), (0.0, 25.0, 50.0, 80.0)),
    "round an edge": held(phantoms.slivered_tendon(pulls=PULLS), ((0.0, 0.0), 18.0), PULLS),
    "over two joints": [over_two_joints(pose) for pose in TWO_JOINTS],
}


@pytest.mark.parametrize("name", STRINGS)
def test_a_muscle_is_as_long_as_a_string_past_its_circles(name):
    outward = (0.0, 1.0) if name == "wound" else (-1.0, -1.0 if name == "over two joints" else 0.0)
    for phantom, time, known, circles in STRINGS[name]:
        start, end = (place[1:] for place in moved_ends(phantom, time))
        if name == "wound":  # the free end is attached by its face, the other on the cylinder
            turn = np.radians(80.0 + time)
            start, end = (-80.0, 30.0), 30.0 * np.array([np.sin(turn), np.cos(turn)])
        assert known == pytest.approx(taut_length(start, end, circles, outward), rel=1e-6)


def test_free_muscles_are_as_long_as_the_way_between_their_moved_ends():
    """Of the lifting strap after its lift-off, and of the spindle over a ball."""
    strap, ball = phantoms.lifting_strap(), phantoms.spindle_over_ball()
    assert strap.known["lift_off"] == 30.0
    poses = zip(*ball.known["coordinates"].values(), strict=True)
    cases = [(strap, angle, (angle,)) for angle in (33.0, 50.0, 70.0)]
    for phantom, time, pose in cases + [
        (ball, t, pose) for t, pose in zip(ball.motion.times, poses, strict=True)
    ]:
        origin, insertion = moved_ends(phantom, time)
        assert phantom.known["length"](*pose) == pytest.approx(np.linalg.norm(insertion - origin), rel=1e-12)


def brims_straight(angle):
    origin, insertion = moved_ends(phantoms.flexor_over_brim(), angle)
    return np.linalg.norm(insertion - origin)


def arms_and_lengths():
    """Yield by phantom: moment arm, length by the angle alone, and angle [degrees]."""
    strap, brim, ring = (
        make().known
        for make in (phantoms.lifting_strap, phantoms.flexor_over_brim, phantoms.tendon_through_ring)
    )
    two, ball, wound = (
        make().known
        for make in (phantoms.strap_over_two_joints, phantoms.spindle_over_ball, phantoms.wrapping_cylinder)
    )
    for depth in (-5.0, 0.0, 3.0):
        for q in (0.0, 15.0, 29.0, 31.0, 45.0, 70.0):
            yield strap["moment_arm"](q, depth), lambda q, d=depth: strap["length"](q, d), q
    for q in (0.0, 20.0, 47.0, 80.0):
        yield brim["moment_arm"](q), brim["length"], q
    for q in (13.0, 46.0):  # between rows the motion is that of the hinge, as well
        yield brim["straight_moment_arm"](q), brims_straight, q
    for clearance in (0.0, 3.5):
        for q in (2.0, 25.0, 60.0):
            yield ring["moment_arm"](q, clearance), lambda q, c=clearance: ring["length"](q, c), q
    yield wound["moment_arm"], wound["length"], 15.0
    for a, b in TWO_JOINTS:
        yield two["moment_arm_upper"], lambda q, b=b: two["length"](q, b), a
        yield two["moment_arm_lower"], lambda q, a=a: two["length"](a, q), b
    for a, b in BALL:
        yield ball["moment_arm_flexion"](a, b), lambda q, b=b: ball["length"](q, b), a
        yield ball["moment_arm_abduction"](a, b), lambda q, a=a: ball["length"](a, q), b


def test_moment_arms_are_the_slopes_of_lengths():
    step = 1e-4
    for arm, length, angle in arms_and_lengths():
        slope = (length(angle + step) - length(angle - step)) / (2.0 * np.radians(step))
        assert arm == pytest.approx(-slope, abs=1e-5)
    known = phantoms.flexor_over_brim().known
    assert known["straight_moment_arm"](0.0) < 0.0 < known["moment_arm"](0.0)


@pytest.mark.parametrize("clearance", [0.0, 3.5])
@pytest.mark.parametrize("angle", [0.0, 12.0, 60.0])
def test_tendon_is_as_long_as_the_shortest_way_through_its_ring(angle, clearance):
    phantom = phantoms.tendon_through_ring()
    start, end = moved_ends(phantom, angle)
    *_, ring = attachments_of(phantom.attachments["muscle"], "test")
    centre, reach = ring.landmarks.mean(axis=0), 6.0 - clearance

    def way(y):
        place = centre + np.array([0.0, y, 0.0])
        return np.linalg.norm(place - start) + np.linalg.norm(place - end)

    shortest = minimize_scalar(way, bounds=(-reach, reach), options={"xatol": 1e-6}).fun
    assert phantom.known["length"](angle, clearance) == pytest.approx(shortest, abs=1e-5)
    muscle = phantom.muscles["muscle"]
    assert passes_through(via_ring(ring.landmarks), points_of(muscle), triangles_of(muscle, "test"))
