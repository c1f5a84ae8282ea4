"""What is written for MuJoCo has the same lengths and moment arms there (extra ``mujoco``)."""

import numpy as np
import pytest
from legs import leg

from vtkmuscle.joints.functions import IDENTITY, CubicSpline, Polynomial
from vtkmuscle.joints.tree import Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.opensim import MuscleOut, check_model, mjcf_of, read_mjcf
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
        (PointPath([PathPoint("femur"), PathPoint("tibia", only_in=("knee", 0, 1))]), "no moving or condit"),
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


#: Two joints on a body, a slide, a ball, a free body, and rotated frames, with rests other than zero.
MANY = """<mujoco model="many"><compiler angle="radian" autolimits="true"/><worldbody>
  <site name="a" pos="0.1 0.2 0"/>
  <body name="one" pos="0 0.5 0.1" quat="0.9 0.1 0.3 0.2">
    <joint name="flexion" axis="0 0 1" pos="0.01 0.02 0" range="-1 1"/>
    <joint name="turn" axis="0 1 1" pos="0 0.03 0" range="-1 1" ref="0.2"/>
    <geom name="round" type="cylinder" size="0.02 0.1"/><site name="b" pos="0.03 0.01 0"/>
    <body name="two" pos="0.1 0.4 0" euler="0.2 0.1 0.4">
      <joint name="glide" type="slide" axis="1 0.2 0" range="-0.1 0.1"/><joint name="follows" axis="1 0 0"/>
      <geom size="0.01"/><site name="c" pos="0.03 0.2 0.1"/>
    </body></body>
  <body name="three" pos="1 0 0"><joint name="ball" type="ball"/><geom size="0.01"/><site name="d"/></body>
  <body name="four" pos="2 0 0"><freejoint name="loose"/><geom size="0.01"/></body></worldbody>
  <equality><joint joint1="follows" joint2="turn" polycoef="0.1 0.5 0.2 0 0"/>
    <joint joint1="flexion" polycoef="0.3"/></equality>
  <tendon><spatial name="long"><site site="a"/><geom geom="round"/><site site="b"/><site site="c"/></spatial>
    <spatial name="passive"><site site="a"/><site site="d"/></spatial>
    <fixed name="sum"><joint joint="turn" coef="1"/></fixed></tendon>
  <actuator><muscle name="m" tendon="long" lengthrange="0.5 0.9" range="0.75 1.05" force="100"/>
    <motor name="motor" joint="turn"/></actuator></mujoco>"""


@pytest.fixture
def many(tmp_path):
    pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    (tmp_path / "many.xml").write_text(MANY)
    return read_mjcf(tmp_path / "many.xml")


def test_a_read_model_moves_as_in_mujoco(many, rng):
    mujoco = pytest.importorskip("mujoco")
    assert many.tree.free == ("flexion", "turn", "glide", "ball", "loose")
    assert [(each.name, each.rest) for each in many.tree.coordinates if each.locked] == [("flexion", 0.3)]
    values = {name: rng.uniform(-0.1, 0.1, 4) for name in ("flexion", "turn", "glide")}
    poses, full, data = many.tree.poses(values), many.tree.completed(values), mujoco.MjData(many.compiled)
    lengths = many.lengths(["m", "passive"], values)
    for row in range(4):
        for name in ("flexion", "turn", "glide", "follows"):
            data.joint(name).qpos[0] = full[name][row]
        mujoco.mj_forward(many.compiled, data)
        for body in ("one", "two", "three", "four"):
            np.testing.assert_allclose(poses[body][row, :3, 3], data.body(body).xpos, atol=1e-12)
            np.testing.assert_allclose(poses[body][row, :3, :3].ravel(), data.body(body).xmat, atol=1e-12)
        assert lengths["m"][row] == pytest.approx(data.tendon("long").length[0], abs=1e-12)
    # The equality is kept, as by MuJoCo's residual.
    assert np.abs(full["follows"] - np.polyval([0.2, 0.5, 0.1], full["turn"] - 0.2)).max() < 1e-12


@pytest.mark.optional
def test_a_read_model_has_muscles_ligaments_and_what_is_left_out(many):
    assert (list(many.muscles), list(many.ligaments)) == (["m"], ["passive"])
    assert many.not_used == ("actuator motor", "tendon sum")
    assert many.muscles["m"].path.coordinates(many.tree) == ("flexion", "turn", "glide")
    assert many.ligaments["passive"].path.coordinates(many.tree) == ("ball",)
    hill = many.muscles["m"].parameters  # 0.4 m are 0.3 optimal lengths, from 0.75 on
    assert hill["optimal_fiber_length"] == pytest.approx(4.0 / 3.0)
    assert hill["tendon_slack_length"] == pytest.approx(0.5 - 1.0)
    assert hill["max_isometric_force"] == 100.0


def test_a_written_model_is_read_with_the_same_lengths(tmp_path, rng):
    pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    tree = leg()
    (tmp_path / "leg.xml").write_text(mjcf_of(tree, [MuscleOut("vastus", PATH)]))
    model = read_mjcf(tmp_path / "leg.xml")
    assert set(tree.free) <= set(model.tree.free)
    values = {name: rng.uniform(-0.8, 0.8, 5) for name in tree.free}
    own = model.lengths(["vastus"], values)["vastus"]
    np.testing.assert_allclose(own, PATH.lengths(tree, values), atol=1e-9)


FLIP = """<mujoco model="arm"><compiler angle="radian" autolimits="true"/><worldbody>
  <site name="a" pos="-0.15 0 0"/>
  <body><joint name="shoulder" axis="0 0 1" range="0 2.1"/>
    <geom name="round" type="cylinder" size="0.1 0.05"/>
    <site name="b" pos="0.15 -0.06 0"/></body></worldbody>
  <tendon><spatial name="t"><site site="a"/><geom geom="round"/><site site="b"/></spatial>
  </tendon><actuator><muscle name="extensor" tendon="t"/></actuator></mujoco>"""


def test_a_muscle_of_mujoco_that_flips_over_a_cylinder_is_found(tmp_path):
    pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    (tmp_path / "arm.xml").write_text(FLIP)
    jump = check_model(tmp_path / "arm.xml").findings[0]
    assert (jump.muscle, jump.coordinate, jump.what) == ("extensor", "shoulder", "moment arm jumps")
    # The shorter side changes where the end is opposite of the start, from the radius to minus the radius.
    assert np.radians(jump.pose["shoulder"]) == pytest.approx(np.arctan(0.06 / 0.15), abs=1e-3)
    assert jump.size == pytest.approx(0.2, rel=1e-3)


def test_a_broken_model_of_mujoco_names_its_file(tmp_path):
    pytest.importorskip("mujoco", reason="the extra mujoco is not installed")
    (tmp_path / "arm.xml").write_text(FLIP.replace('geom geom="round"', 'geom geom="square"'))
    with pytest.raises(ValueError, match=r"arm\.xml: MuJoCo does not read the model: .*square"):
        read_mjcf(tmp_path / "arm.xml")
    with pytest.raises(FileNotFoundError, match="missing"):
        read_mjcf(tmp_path / "missing.xml")
