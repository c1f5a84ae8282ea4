import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spindle import spindle

from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.pbd import coarse
from vtkmuscle.core.pbd.resolution import ReducedMuscle


@pytest.fixture(scope="module")
def full():
    return spindle(rings=40, around=24)


@pytest.fixture(scope="module")
def reduced(full):
    return ReducedMuscle(*full, max_triangles=400)


def test_it_has_no_more_triangles_than_allowed(reduced):
    assert 300 < len(reduced.triangles) <= 400


def test_a_rigid_motion_is_carried_exactly(full, reduced):
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_euler("xyz", [20, 50, -110], degrees=True).as_matrix()
    motion[:3, 3] = [5.0, -200.0, 30.0]
    carried = reduced.carry(apply_transform(motion, reduced.points), np.array([motion, motion]))
    np.testing.assert_allclose(carried, apply_transform(motion, full[0]), atol=1e-9)
    report = reduced.report(carried)
    assert report.edge_stretch_max == pytest.approx(1.0)
    assert report.dihedral_error_p95 < 1e-6


def test_fixed_points_follow_their_bones_and_the_volume_is_kept(full, reduced):
    points, triangles, fixed_to = full
    motions = np.array([np.eye(4), np.eye(4)])
    motions[1, :3, 3] = [4.0, 0.0, -3.0]
    # The reduced muscle is sheared; where its points are fixed need not be where those of the full one are.
    height = np.ptp(points[:, 2])
    shear = np.array([4.0, 0.0, -3.0]) * ((reduced.points[:, 2:] - points[:, 2].min()) / height)
    carried = reduced.carry(reduced.points + shear, motions)
    for bone in (0, 1):
        held = fixed_to == bone
        np.testing.assert_allclose(carried[held], apply_transform(motions[bone], points[held]), atol=1e-12)
    ratio = signed_volume(carried, triangles) / signed_volume(points, triangles)
    assert ratio == pytest.approx(1.0, abs=1e-9)
    assert reduced.report(carried).volume_ratio == pytest.approx(ratio)


def test_a_muscle_that_falls_apart_is_refused(full, monkeypatch):
    def torn(points, triangles, n_coarse, held):
        return points, triangles[: 2 * n_coarse]

    monkeypatch.setattr(coarse, "decimate", torn)
    with pytest.raises(ValueError, match=r"cannot be decimated to 200 and stay closed"):
        ReducedMuscle(*full, max_triangles=400)
