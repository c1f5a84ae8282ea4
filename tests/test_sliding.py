"""A muscle that slides off a condyle is told of: the bone, the frame, and what to do."""

import numpy as np
import pytest
from phantoms import leg

from vtkmuscle import Scene
from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.motion.rigid import RigidMotion, rotation_about
from vtkmuscle.data.arrays import surface_from
from vtkmuscle.data.attachments import VIA, AttachmentArea, attachments_from, attachments_of
from vtkmuscle.phantoms.implicit import thick_curve
from vtkmuscle.phantoms.meshing import mesh_of, solid_of_revolution
from vtkmuscle.run.limits import CHECKS
from vtkmuscle.run.verdict import FibreHistory, judge, slides_of
from vtkmuscle.scene.data import Muscle

#: A cord beside the front of the femur, which the knee draws over the side of the condyle as it flexes and
#: the tibia turns inwards; flexion alone leaves it there [mm].
BESIDE = [(-66, -6, -120), (-66, -10, -230), (-50, -16, -330), (-32, -22, -400), (-28, -24, -440)]
BESIDE += [(-24, -24, -468)]
RADII = [7.0, 13.0, 11.0, 6.0, 5.5, 5.0]
#: On the axis of the tibia, between the condyles [mm].
KNEE = (-20.0, 0.0, -430.0)


@pytest.fixture(scope="module")
def bone():
    """A roller of radius 20 along z."""
    points, triangles = solid_of_revolution([-60.0, 60.0], [20.0, 20.0], 48)
    return Bone(points, triangles)


def over_roller(aside, lifted=0.0):
    """Return a line over the top of the roller, across it, moved along the roller and off it."""
    x = np.linspace(-40.0, 40.0, 33)
    return np.column_stack([x, np.sqrt(np.maximum(24.0**2 - x**2, 0.0)) + lifted, np.full(33, aside)])[None]


def jumping(lines, bone, motion):
    lengths = np.full((len(lines), 1), 100.0)
    lengths[5:] = 80.0
    return slides_of(lengths, lines.__getitem__, motion, {"femur": bone}, jump=1.0)


@pytest.fixture(scope="module")
def still():
    """A motion of nine frames in which nothing moves but a far bone, evenly."""
    from vtkmuscle import hinge

    return hinge("far", (0, 0, 0), (1, 0, 0), np.arange(9.0))


def test_what_slides_along_the_roller_has_slid_off_it(bone, still):
    slides = jumping([over_roller(0.0)] * 5 + [over_roller(7.0)] * 4, bone, still)
    assert [one is not None for one in slides] == [number == 5 for number in range(9)]
    assert slides[5] == (pytest.approx(7.0), "femur")


def test_what_lifts_off_or_runs_along_its_own_line_has_not(bone, still):
    lifted = jumping([over_roller(0.0)] * 5 + [over_roller(0.0, 9.0)] * 4, bone, still)
    assert lifted[5] is None or lifted[5][0] < 1e-9
    along = [over_roller(0.0)] * 5 + [over_roller(0.0) + np.array([0.5, 0.0, 0.0])] * 4
    assert jumping(along, bone, still)[5] is None or jumping(along, bone, still)[5][0] < 1e-9


def test_the_verdict_names_the_bone_the_frame_and_the_remedy():
    rows = [{"frame": 3 * i, "time": float(i)} for i in range(4)]
    slides = [None, None, (8.5, "femur"), None]
    lengths = np.full((4, 2), 100.0)
    verdict = judge(rows, FibreHistory(lengths, lengths[0], slides=slides))
    assert verdict["verdict"] == "look"
    (reason,) = verdict["reasons"]
    assert (reason["check"], reason["frame"], reason["value"]) == ("slid off", 6, 8.5)
    assert "slides off the bone 'femur' sideways, by 8.5 mm" in reason["says"]
    assert "via ring" in reason["do"]


def cord_over(motion, rings=()):
    """Run the cord beside the vastus with a motion of the leg, and via rings on its way."""
    phantom = leg()
    one = Scene.from_phantom(phantom, n_fibres=12)
    line, radii = np.array(BESIDE, dtype=np.float64), np.array(RADII)
    cord = surface_from(*mesh_of(thick_curve(line, radii), 2.5, 1500))
    areas = attachments_from([*attachments_of(phantom.attachments["vastus"], "test"), *rings])
    muscle = Muscle(cord, areas, {"n_fibres": 12})
    result = Scene("slides", one.bones, {"cord": muscle}, motion, deformer="none").run(figures=False)
    return result.report["muscles"]["cord"]["verdict"]


def turned_inwards(motion, degrees):
    """Return a motion of the leg seen from the femur, in which the tibia turns inwards as the knee flexes."""
    femur, tibia = motion.transforms["femur"], motion.transforms["tibia"]
    turns = [rotation_about(KNEE, (0, 0, -1), angle) for angle in np.linspace(0.0, degrees, len(femur))]
    return RigidMotion(motion.times, {"tibia": np.linalg.inv(femur) @ tibia @ np.array(turns)})


def test_a_cord_that_the_knee_draws_off_the_condyle_is_told_of():
    verdict = cord_over(turned_inwards(leg().motion, 50.0))
    found = {reason["check"]: reason for reason in verdict["reasons"]}
    assert verdict["verdict"] != "ok"
    assert found["slid off"]["value"] > CHECKS["slid off"].look
    assert "'femur'" in found["slid off"]["says"]


def test_the_remedy_helps():
    """A ring on the femur, round the cord where it crosses the condyle, holds it there."""
    across = np.array([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
    turns = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    circle = np.array(BESIDE[4]) + 6.5 * np.column_stack([np.cos(turns), np.sin(turns)]) @ across
    ring = AttachmentArea(VIA, "femur", circle, closed=True)
    verdict = cord_over(turned_inwards(leg().motion, 50.0), [ring])
    assert "slid off" not in {reason["check"] for reason in verdict["reasons"]}


def test_a_cord_that_stays_on_the_condyle_is_not():
    assert cord_over(leg().motion)["verdict"] == "ok"
