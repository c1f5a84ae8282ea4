"""What strings do to bones: all of it together is nothing, and about an axis it is the known moment arm.

The segments of a string of n points and length l are h = l / (n - 1) long. Wound round a radius r its corners
are on that, and its lever is between that of a chord, r cos(h / 2 r), and r; bones of flat triangles add 1 %.
"""

import numpy as np
import pytest
from taut_phantoms import known_paths, levers, strung_phantom, swept

from vtkmuscle.core.motion.rigid import apply_transform, hinge
from vtkmuscle.core.taut.wrenches import path_wrenches
from vtkmuscle.phantoms.two_joint_strap import ARMS

AXIS = np.array([-1.0, 0.0, 0.0])
FACETS = 0.01


def chord(state, radius):
    """Return by how much the lever of a chord round a radius is less than that [mm]."""
    segment = state.lengths.max() / (state.points.shape[1] - 1)
    return radius * (1.0 - np.cos(segment / (2.0 * radius)))


def poses_about(make, bone, angles, **settings):
    made = strung_phantom(make, **settings)
    return made, made.poses(hinge(bone, (0, 0, 0), AXIS, angles))


@pytest.mark.parametrize(
    ("make", "bone"), [("flexor_over_brim", "distal"), ("tendon_through_ring", "distal")]
)
def test_forces_and_moments_of_a_string_are_none_in_all(make, bone):
    """Nothing but bones holds it: about any point, so also in a scene that is far from its origin."""
    _, poses = poses_about(make, bone, np.arange(0.0, 61.0, 15.0))
    for state in swept(known_paths(make), poses):
        np.testing.assert_allclose(state.wrenches.sum(axis=1), 0.0, atol=1e-11)
        assert np.linalg.norm(state.wrenches[:, :, :3], axis=2).max() <= 2.0 + 1e-12


def test_bones_that_move_together_leave_the_wrenches_as_they_are_on_them():
    made = strung_phantom("flexor_over_brim")
    paths = known_paths("flexor_over_brim")
    carried = hinge("all", (50.0, 20.0, 0.0), (1, 2, 3), [0.0, 70.0]).transforms["all"][1]
    before = paths.rest
    after = paths.follow(before, np.array([carried] * len(made.names)))
    force = before.wrenches[:, :, :3] @ carried[:3, :3].T
    np.testing.assert_allclose(after.wrenches[:, :, :3], force, atol=1e-9)
    moment = before.wrenches[:, :, 3:] @ carried[:3, :3].T + np.cross(carried[:3, 3], force)
    np.testing.assert_allclose(after.wrenches[:, :, 3:], moment, atol=1e-7)


def test_a_strap_on_a_cylinder_has_its_radius_as_lever_in_every_pose():
    made, poses = poses_about("wrapping_cylinder", "pulley", np.arange(-60.0, 81.0, 4.0))
    known = made.phantom.known["moment_arm"]
    for state in swept(known_paths("wrapping_cylinder"), poses):
        mean = levers(state, [made.names.index("pulley")], (0, 0, 0), AXIS).mean()
        assert FACETS * known < mean - known < chord(state, -known) - FACETS * known


def test_a_spindle_in_free_space_has_the_lever_of_the_line_between_its_ends():
    made = strung_phantom("spindle_over_ball")
    known, distal = made.phantom.known, made.names.index("distal")
    paths = known_paths("spindle_over_ball")
    poses = made.poses()
    flexion, abduction = (known["coordinates"][name] for name in ("flexion", "abduction"))
    for state, at in zip(swept(paths, poses), zip(flexion, abduction, strict=True), strict=True):
        turned = hinge("distal", (0, 0, 0), AXIS, [at[0]]).transforms["distal"][0][:3, :3] @ [0.0, 1.0, 0.0]
        ends = apply_transform(state.transforms[distal], paths.fibres[:, -1])
        pull = paths.fibres[:, 0] - ends
        pull /= np.linalg.norm(pull, axis=1, keepdims=True)
        for axis in (AXIS, turned):
            right = np.cross(ends, pull) @ axis
            np.testing.assert_allclose(levers(state, [distal], (0, 0, 0), axis), right, atol=1e-6)


def test_a_strap_over_two_joints_has_both_rollers_as_levers_in_every_pose():
    made = strung_phantom("strap_over_two_joints")
    numbers = [made.names.index(name) for name in ("middle", "distal")]
    known = made.phantom.known
    off = {"upper": [], "lower": []}
    for state in swept(known_paths("strap_over_two_joints"), made.poses()):
        centre = np.array([known["centres"]["lower"]])
        lower = apply_transform(state.transforms[numbers[0]], centre)[0]
        upper_arm = levers(state, numbers, (0, 0, 0), AXIS).mean()
        lower_arm = levers(state, numbers[1:], lower, -AXIS).mean()
        off["upper"].append(ARMS[0] - upper_arm)
        off["lower"].append(lower_arm + ARMS[1])
        for name, radius in zip(off, ARMS, strict=True):
            assert -FACETS * radius < off[name][-1] < chord(state, radius) + FACETS * radius


def test_a_corner_presses_on_the_bone_that_holds_it():
    corner = np.array([[[0.0, 0.0, 0.0], [30.0, 40.0, 0.0], [60.0, 0.0, 0.0]]])
    shares = np.zeros((3, 1, 3))
    shares[[0, 1, 2], 0, [0, 1, 2]] = 1.0
    found = path_wrenches(corner, shares)[0]
    np.testing.assert_allclose(found[1], [0.0, -1.6, 0.0, 0.0, 0.0, -48.0])
    np.testing.assert_allclose(found[0], [0.6, 0.8, 0.0, 0.0, 0.0, 0.0])
