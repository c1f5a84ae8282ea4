"""Models of OpenSim read without it: what is understood, and what is named in an error."""

import numpy as np
import osim_texts as texts
import pytest

from vtkmuscle.core.motion.rigid import frame_at, turns
from vtkmuscle.joints.functions import CubicSpline, PiecewiseLinear
from vtkmuscle.opensim import read_osim


def read(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "leg.osim"
    path.write_bytes(text.encode(encoding))
    return read_osim(path)


def test_custom_joint_of_version_4_is_where_its_functions_say(tmp_path):
    tree = read(tmp_path, texts.model_4()).tree
    q = np.array([-0.7, 0.4])
    np.testing.assert_allclose(tree.joints[0].parent_frame, frame_at((0, 0.9, 0), (0.1, 0.2, 0.3)))
    expected = np.tile(np.eye(4), (2, 1, 1))
    expected[:, :3, :3] = turns(np.array([0, 0, 1.0]), q) @ turns(
        np.array([1.0, 0, 0]), 0.5 * (0.1 * q**2 + 0.2 * q)
    )
    x, y = [-2, -1, 0, 1, 2], [0.01, 0.02, -0.01, 0.03, 0]
    expected[:, 0, 3] = CubicSpline(x, y)(q)
    expected[:, 2, 3] = PiecewiseLinear(x, y)(q)
    expected[:, 1, 3] = -0.4
    poses = tree.poses({"knee_angle": q})
    np.testing.assert_allclose(np.linalg.inv(poses["femur"]) @ poses["tibia"], expected, atol=1e-12)
    assert tree.coordinate("knee_angle").rest == 0.1
    assert tree.coordinate("knee_angle").range == (-2.0, 2.0)


def test_version_3_is_read_whatever_its_letters(tmp_path):
    model = read(tmp_path, texts.model_3(), "latin-1")
    pose = model.tree.poses({"knee_angle": [0.0]})["tibia"][0]
    expected = frame_at((0, 0.5, 0), (0.1, 0, 0.2)) @ np.linalg.inv(frame_at((0, 0.1, 0), (0, 0.3, 0)))
    np.testing.assert_allclose(pose, expected, atol=1e-12)
    assert model.meshes[0][1] == "tibia.vtp"


def test_muscles_have_their_points_and_parameters(tmp_path):
    model = read(tmp_path, texts.model_4(forces=texts.muscle(texts.MOVING)))
    muscle = model.muscle("vastus")
    assert muscle.parameters == {"max_isometric_force": 900.0, "optimal_fiber_length": 0.08}
    assert [point.moves for point in muscle.path.points] == [False, True, False]
    assert muscle.path.coordinates(model.tree) == ("knee_angle",)
    model = read(tmp_path, texts.model_4(forces=texts.muscle(texts.CONDITIONAL)))
    assert model.muscle("vastus").path.points[1].only_in == ("knee_angle", -3.0, -0.2)
    with pytest.raises(ValueError, match="did you mean 'vastus'"):
        model.muscle("vasti")


def test_a_coupler_leads_its_coordinate(tmp_path):
    coupler = """<CoordinateCouplerConstraint name="c"><isEnforced>true</isEnforced>
<coupled_coordinates_function><LinearFunction><coefficients>2 0.1</coefficients></LinearFunction>
</coupled_coordinates_function><independent_coordinate_names>knee_angle</independent_coordinate_names>
<dependent_coordinate_name>hip_x</dependent_coordinate_name><scale_factor>0.5</scale_factor>
</CoordinateCouplerConstraint>"""
    tree = read(tmp_path, texts.model_4(constraints=coupler)).tree
    np.testing.assert_allclose(tree.completed({"knee_angle": [0.3]})["hip_x"], [0.35])
    off = coupler.replace("<isEnforced>true", "<isEnforced>false")
    model = read(tmp_path, texts.model_4(constraints=off))
    assert not model.tree.couplings
    assert "switched off" in model.not_used[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (texts.model_4(more="<WaterSet/>"), "WaterSet: is not supported in Model 'leg'"),
        (texts.model_4(joint_extra="<gears>2</gears>"), "gears: is not supported in CustomJoint 'knee'"),
        (texts.model_4().replace("BallJoint", "ScapulothoracicJoint"), "this kind of joint is not"),
        (texts.model_4().replace("SimmSpline", "GCVSpline"),
         "GCVSpline 'function': is not supported in TransformAxis"),
        (texts.model_4().replace("/ground</so", "ground_offset</so"), "offsets of each other"),
        (texts.model_4(constraints='<WeldConstraint name="w"/>'), "WeldConstraint 'w': this constr"),
        (texts.model_4().replace("femur</socket_parent>", "femut</socket_parent>"), "'femut'"),
        (texts.model_4().replace("<Coordinate name=\"hip_z\"/>", ""), "has 2 coordinates, but must have 3"),
        (texts.model_4().replace("0 0.9 0", "0 0.9"), "must hold 3 finite numbers"),
        (texts.model_4().replace("0 0.9 0", "0 inf 0"), "must hold 3 finite numbers"),
        (texts.model_4().replace("<axis>0 0 1</axis>", "<axis>0 0 0</axis>"), "have a length"),
        (texts.model_4().replace("-2 -1 0 1 2</x>", "-2 -1 -1 1 2</x>"), "must ascend"),
        (texts.model_4().replace("meters", "furlongs"), "there is no unit 'furlongs'"),
        (texts.model_4(forces=texts.muscle(texts.MOVING.replace("MovingPath", "FlyingPath"))),
         "this kind of path point is not supported"),
        (texts.model_4(forces=texts.muscle(texts.CONDITIONAL.replace("e_a", "ea"))),
         "did you mean 'knee_angle'"),
        (texts.model_3(reverse="true"), "reverse"),
        ("<a/>", "not a model of OpenSim"),
        ("<OpenSimDocument>", "line 1: the file is not XML"),
        ("\x00\x01", "not XML"),
        ("<a>" * 200, "deeper than"),
    ],
)  # fmt: skip
def test_what_is_not_understood_is_named(tmp_path, text, words):
    with pytest.raises(ValueError, match=words):
        read(tmp_path, text)


def test_entities_are_refused(tmp_path):
    laughs = """<!DOCTYPE lolz [<!ENTITY lol "lol"><!ENTITY a "&lol;&lol;">]><OpenSimDocument/>"""
    with pytest.raises(ValueError, match="DOCTYPE"):
        read(tmp_path, laughs)
    reaching = (
        """<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/hostname">]><OpenSimDocument>&e;</OpenSimDocument>"""
    )
    with pytest.raises(ValueError, match="DOCTYPE"):
        read(tmp_path, reaching)


def test_forces_without_a_path_are_listed(tmp_path):
    model = read(tmp_path, texts.model_4(forces='<CoordinateActuator name="reserve"/>'))
    assert "CoordinateActuator 'reserve'" in model.not_used[0]


OFFSET = """<PhysicalOffsetFrame name="off"><socket_parent>..</socket_parent>
<translation>0 {0} 0</translation><orientation>0 0 0</orientation></PhysicalOffsetFrame>"""


def test_frames_of_one_name_belong_to_their_owners(tmp_path):
    """The owner is "..", as OpenSim 4 writes when it upgrades a model."""
    text = texts.model_4(forces=texts.muscle(texts.MOVING))
    for body, height in (("femur", 0.01), ("tibia", 0.02)):
        frame = f'<Body name="{body}"><components>{OFFSET.format(height)}</components>'
        text = text.replace(f'<Body name="{body}">', frame)
        socket = f"/bodyset/{body}</socket_parent_frame>\n<location>"
        text = text.replace(socket, socket.replace("</", "/off</"))
    first, _, last = read(tmp_path, text).muscle("vastus").path.points
    assert (first.body, last.body) == ("femur", "tibia")
    np.testing.assert_allclose([first.position, last.position], [[0.03, -0.09, 0], [0.04, -0.03, 0]])
    with pytest.raises(ValueError, match="2 frames have the name 'off'; /bodyset/femur/off, /bodyset/tibia"):
        read(tmp_path, text.replace("/bodyset/tibia/off", "off"))


def test_an_axis_without_a_function_stays(tmp_path):
    axes = [texts.axis("rotation1", "0 0 1", "knee_angle", "LinearFunction", texts.LINE)]
    axes.append('<TransformAxis name="translation1"><coordinates/><axis>1 0 0</axis></TransformAxis>')
    assert not read(tmp_path, texts.model_4(axes=axes)).tree.joints[1].axes[1].at({}, 1).any()


def test_paths_that_are_not_muscles_or_not_computed_are_named(tmp_path):
    passive = texts.muscle("").replace("Thelen2003Muscle", "Ligament").replace("vastus", "cruciate")
    unknown = (
        """<PathActuator name="winding"><path><Scholz2015GeometryPath name="path"/></path></PathActuator>"""
    )
    model = read(tmp_path, texts.model_4(forces=passive + unknown + '<MyPlugin name="p"/>'))
    assert (list(model.muscles), list(model.ligaments)) == (["winding"], ["cruciate"])
    assert model.muscle("winding").path.wraps == ("Scholz2015GeometryPath",)
    assert "MyPlugin 'p'" in model.not_used[0]
