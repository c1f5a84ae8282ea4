"""What is written for MuJoCo has the same lengths and moment arms there (extra ``mujoco``)."""

import numpy as np
import pytest
from legs import leg

from vtkmuscle.joints.functions import IDENTITY, CubicSpline, Polynomial
from vtkmuscle.joints.tree import Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.opensim import MuscleOut, mjcf_of
from vtkmuscle.opensim.muscle_paths import FunctionPath, PathPoint, PointPath, moment_arm

PATH = PointPath(
    [
        PathPoint("ground", (0.05, 1.0, 0.02)),
        PathPoint("femur", (0.05, -0.38, 0.0)),
        PathPoint("patella", (0.06, 0.01, 0.0)),
        PathPoint("tibia", (0.03, -0.1, 0.0)),
    ]
)


def test_mujoco_has_the_same_lengths_and_moment_arms(rng):
    mujoco = pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    tree = leg()
    model = mujoco.MjModel.from_xml_string(mjcf_of(tree, [MuscleOut("vastus", PATH)]))
    data = mujoco.MjData(model)
    for _ in range(3):
        values = {name: rng.uniform(-0.8, 0.8, 1) for name in tree.free}
        full = tree.completed(values)
        hidden = {"knee_joint_hinge2": Polynomial([0.05, 0.1, 0.0])(full["knee"])}
        for name, value in {**full, **hidden}.items():
            data.qpos[model.joint(name).qposadr[0]] = value[0]
        mujoco.mj_forward(model, data)
        assert data.ten_length[0] == pytest.approx(PATH.lengths(tree, values)[0], abs=1e-9)
        for body, pose in tree.poses(values).items():
            if body != "ground":
                np.testing.assert_allclose(data.body(body).xpos, pose[0, :3, 3], atol=1e-12)
                np.testing.assert_allclose(data.body(body).xmat.reshape(3, 3), pose[0, :3, :3], atol=1e-12)
        slopes = np.zeros((1, model.nv))
        for i in range(model.nv):
            step = np.zeros(model.nv)
            step[i] = 1e-6
            ends = []
            for sign in (-1, 1):
                moved = mujoco.MjData(model)
                moved.qpos[:] = data.qpos + sign * step
                mujoco.mj_forward(model, moved)
                ends.append(moved.ten_length[0])
            slopes[0, i] = (ends[1] - ends[0]) / 2e-6
        for name in ("hip", "adduction", "pull"):
            arm = -slopes[0, model.joint(name).dofadr[0]]
            assert arm == pytest.approx(moment_arm(PATH, tree, values, name)[0], abs=1e-4)
        chain = {"knee": 1.0, "knee_joint_hinge2": 0.1 * full["knee"][0] + 0.1, "slide": 0.6}
        arm = -sum(part * slopes[0, model.joint(name).dofadr[0]] for name, part in chain.items())
        assert arm == pytest.approx(moment_arm(PATH, tree, values, "knee")[0], abs=1e-4)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        (FunctionPath(("knee",), 1, np.array([0.3, 0.1])), "a function of coordinates"),
        (
            PointPath([PathPoint("femur"), PathPoint("tibia", (0, 0, 0), only_in=("knee", 0.0, 1.0))]),
            "no moving or conditional points",
        ),
    ],
)
def test_what_mujoco_has_not_is_told(path, words):
    with pytest.raises(ValueError, match=words):
        mjcf_of(leg(), [MuscleOut("m", path)])


def test_splines_are_refused():
    spline = JointAxis((0, 0, 1), CubicSpline([0, 1, 2], [0, 1, 0]), "q")
    joints = [Joint("a", "g", "b", [JointAxis((0, 0, 1), IDENTITY, "q"), spline])]
    with pytest.raises(ValueError, match="CubicSpline"):
        mjcf_of(KinematicTree("g", joints, [JointCoordinate("q")]))
