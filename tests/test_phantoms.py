"""Phantoms: sound surfaces, attached muscles, and the answers that they promise."""

import numpy as np
import phantoms
import pytest
import pyvista as pv

from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.template import KINDS
from vtkmuscle.data import arrays
from vtkmuscle.data.attachments import attachments_of
from vtkmuscle.filters import FibreMetrics, FibreSource
from vtkmuscle.pipelines import decompose

PHANTOMS = [
    *("spindle_over_hinge", "wrapping_cylinder", "lifting_strap", "flexor_over_brim"),
    *(
        "strap_over_two_joints",
        "spindle_over_ball",
        "slivered_tendon",
        "tendon_through_ring",
        "pennate_belly",
        "pennate_block",
    ),
    *("hip", "leg"),
]
every_block = pytest.mark.parametrize("kind", KINDS)
every_phantom = pytest.mark.parametrize("make", [getattr(phantoms, name) for name in PHANTOMS], ids=PHANTOMS)


def mesh(surface):
    return arrays.points_of(surface), arrays.triangles_of(surface, "phantom")


def surfaces(phantom):
    return {**dict(arrays.blocks_of(phantom.bones)), **phantom.muscles}


def signed_distances(points, surface):
    """Distances [mm] to a closed surface, negative inside."""
    return pv.PolyData(points).compute_implicit_distance(surface)["implicit_distance"]


@every_phantom
def test_surfaces_are_closed_manifold_and_face_outward(make):
    for name, surface in surfaces(make()).items():
        report = survey(*mesh(surface))
        assert report.closed, name
        assert report.manifold, name
        assert report.oriented, name
        assert report.volume > 0, name
        assert (report.n_components, report.n_unused_points, report.n_degenerate_triangles) == (1, 0, 0), name


@every_phantom
def test_triangles_are_no_slivers(make):
    phantom = make()
    # But for the muscle that is there for its slivers (tests/test_phantom_paths.py).
    for name, surface in (
        dict(arrays.blocks_of(phantom.bones)) if make is phantoms.slivered_tendon else surfaces(phantom)
    ).items():
        angles = pv.wrap(surface).cell_quality("min_angle")["min_angle"]
        assert angles.min() > 10, name
        assert np.median(angles) > 35, name


@every_phantom
def test_muscles_do_not_enter_bones(make):
    phantom = make()
    for name, muscle in phantom.muscles.items():
        for bone, surface in arrays.blocks_of(phantom.bones):
            depth = -signed_distances(arrays.points_of(muscle), surface).min()
            assert depth < 0.5, f"{name} is {depth:.2f} mm deep in {bone}"


@every_phantom
def test_landmarks_lie_on_bone_and_muscle(make):
    phantom = make()
    bones = dict(arrays.blocks_of(phantom.bones))
    for name, muscle in phantom.muscles.items():
        areas = attachments_of(phantom.attachments[name], name)
        assert {area.role for area in areas} - {"via"} == {"origin", "insertion"}
        for area in (area for area in areas if area.role != "via"):
            assert len(area.landmarks) >= 6
            assert np.abs(signed_distances(area.landmarks, bones[area.bone])).max() < 0.8, (name, area.role)
            assert np.abs(signed_distances(area.landmarks, muscle)).max() < 3.0, (name, area.role)
            assert np.abs(signed_distances(area.landmarks, muscle)).mean() < 1.5, (name, area.role)


@every_phantom
def test_each_part_belongs_together(make):
    phantom = make()
    assert set(phantom.attachments) == set(phantom.templates) == set(phantom.muscles)
    assert set(phantom.motion.transforms) < {name for name, _ in arrays.blocks_of(phantom.bones)}
    assert phantom.motion.times[0] == 0.0
    for transform in phantom.motion.at(0.0).values():
        np.testing.assert_allclose(transform, np.eye(4), atol=1e-12)


@every_phantom
def test_bones_do_not_meet_as_they_move(make):
    phantom = make()
    bones = dict(arrays.blocks_of(phantom.bones))
    for time in phantom.motion.times[:: max(1, (len(phantom.motion.times) - 1) // 2)]:
        moved = {
            bone: apply_transform(transform, arrays.points_of(bones[bone]))
            for bone, transform in phantom.motion.at(time).items()
        }
        here = {
            bone: arrays.surface_from(moved.get(bone, arrays.points_of(s)), mesh(s)[1])
            for bone, s in bones.items()
        }
        for moving, points in moved.items():
            for name in set(bones) - {moving}:
                gap = signed_distances(points[::5], here[name]).min()
                assert gap > 0, f"{moving} enters {name} at {time:g}"


# -------------------------------------------------------------------- spindle over a hinge


def test_spindle_has_its_volume(spindle):
    muscle = spindle.muscles["spindle"]
    assert survey(*mesh(muscle)).volume == pytest.approx(spindle.known["volume"], rel=1e-12)
    s = np.linspace(0, 1, 10001)
    smooth = np.pi * 140 * np.trapezoid((7 + 9 * np.sin(np.pi * s) ** 2) ** 2, s)
    assert spindle.known["volume"] == pytest.approx(smooth, rel=0.015)


def test_spindle_length_is_that_between_its_moved_attachments(spindle):
    origin, insertion = attachments_of(spindle.attachments["spindle"], "spindle")
    for angle in spindle.motion.times:
        moved = apply_transform(spindle.motion.at(angle)["distal"], insertion.landmarks)
        length = np.linalg.norm(moved.mean(axis=0) - origin.landmarks.mean(axis=0))
        assert spindle.known["length"](angle) == pytest.approx(length, rel=1e-12)


def test_spindle_moment_arm_is_the_derivative_of_its_length(spindle):
    length, step = spindle.known["length"], 1e-4
    for angle in (0.0, 17.0, 40.0):
        slope = (length(angle + step) - length(angle - step)) / (2 * np.radians(step))
        assert spindle.known["moment_arm"](angle) == pytest.approx(-slope, rel=1e-6)


# -------------------------------------------------------------------- hip


def test_femoral_head_is_a_ball_about_the_origin(hip):
    points = arrays.points_of(dict(arrays.blocks_of(hip.bones))["femur"])
    # Away from the neck, which leaves the head to the side (-x).
    head = points[(points[:, 0] > 8) & (np.linalg.norm(points, axis=1) < 30)]
    assert len(head) > 100
    np.testing.assert_allclose(np.linalg.norm(head, axis=1), hip.known["head_radius"], atol=0.3)


# -------------------------------------------------------------------- by the full chain


def known_of_each(phantom, name, r, s):
    answer = phantom.known[name]
    return np.array([answer(*pair) for pair in zip(r, s, strict=True)]) if callable(answer) else answer


def test_the_bellys_fibres_have_their_known_lengths_and_pennation():
    phantom = phantoms.pennate_belly()
    muscle, known = phantom.muscles["belly"], phantom.known
    assert survey(*mesh(muscle)).volume == pytest.approx(known["volume"], rel=0.03)
    fibres = FibreMetrics()(FibreSource(n_fibres=200)(muscle, phantom.attachments["belly"]), muscle)
    assert arrays.field_string(fibres, "Course") == "straight"
    starts = arrays.polylines_of(fibres, "fibres").points.reshape(200, -1, 3)[:, 0]
    for array, answer, median, most in (
        ("Length", "fibre_length", 0.4, 3.0),
        ("PennationOrigin", "pennation", 0.5, 2.0),
        ("PennationInsertion", "pennation", 0.5, 2.0),
    ):
        error = arrays.cell_array(fibres, array, "fibres") - [known[answer](x) for x in starts[:, 0]]
        assert abs(np.median(error)) < median, array
        assert np.percentile(np.abs(error), 95) < most, array


@every_block
def test_the_chain_of_filters_gives_the_known_lengths_angles_and_volume(kind):
    phantom = phantoms.fibre_block(kind)
    muscle, attachments = phantom.muscles["block"], phantom.attachments["block"]
    fibres = decompose(muscle, attachments, phantom.superficial.get("block"), template=kind)
    measured = FibreMetrics(fibres=fibres, muscle=muscle, architecture=True).update().output
    r, s = (arrays.cell_array(measured, name, kind) for name in ("r", "s"))
    lengths = known_of_each(phantom, "fibre_length", r, s)
    assert np.abs(arrays.cell_array(measured, "Length", kind) / lengths - 1).max() < 0.005
    for end in ("Origin", "Insertion"):
        name = "pennation" if "pennation" in phantom.known else f"pennation_{end.lower()}"
        known = known_of_each(phantom, name, r, s)
        assert np.abs(arrays.cell_array(measured, f"Pennation{end}", kind) - known).max() < 1.0, end
    assert arrays.field_array(measured, "MuscleVolume")[0] == pytest.approx(
        phantom.known["volume"], rel=0.001
    )
