"""Landmarks of 3D Slicer: frames, names, rings, and refused lists."""

import json

import numpy as np
import pytest

from vtkmuscle.io import read_landmarks, read_named_points

POINTS = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 10.0]]
OTHER_SIDE = np.array(POINTS) * [-1, -1, 1]


def markups(kind="Fiducial", frame="LPS", **changes):
    controls = [
        {"id": str(i), "label": f"F-{i}", "position": point, "positionStatus": "defined"}
        for i, point in enumerate(POINTS)
    ]
    one = {"type": kind, "coordinateSystem": frame, "coordinateUnits": "mm", "controlPoints": controls}
    return {"@schema": "https://raw.githubusercontent.com/slicer/x#", "markups": [one | changes]}


def written(tmp_path, name, content):
    path = tmp_path / name
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


@pytest.mark.parametrize(("frame", "expected"), [("LPS", POINTS), ("RAS", OTHER_SIDE)])
def test_markups_are_turned_to_the_frame_of_the_scene(tmp_path, frame, expected):
    path = written(tmp_path, "F.mrk.json", markups(frame=frame))
    points, closed = read_landmarks(path)
    np.testing.assert_array_equal(points, expected)
    assert not closed
    np.testing.assert_array_equal(read_landmarks(path, frame=frame)[0], POINTS)
    assert read_named_points(path).names == ("F-0", "F-1", "F-2")


def test_a_closed_curve_is_a_ring_and_a_curve_is_none(tmp_path):
    assert read_landmarks(written(tmp_path, "a.mrk.json", markups("ClosedCurve")))[1]
    assert not read_landmarks(written(tmp_path, "b.mrk.json", markups("Curve")))[1]


@pytest.mark.parametrize(
    ("system", "expected"), [("LPS", POINTS), ("1", POINTS), ("RAS", OTHER_SIDE), ("0", OTHER_SIDE)]
)
def test_old_lists_say_their_frame_by_word_or_number(tmp_path, system, expected):
    text = f"# Markups fiducial file version = 4.11\n# CoordinateSystem = {system}\n"
    text += "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n"
    text += "\n".join(f'{i},{x},{y},{z},0,0,0,1,1,1,0,"F,{i}",,' for i, (x, y, z) in enumerate(POINTS))
    path = written(tmp_path, "F.fcsv", text)
    np.testing.assert_array_equal(read_landmarks(path)[0], expected)
    assert read_named_points(path).names[1] == "F,1"


def test_a_list_that_does_not_say_its_frame_is_asked_for_it(tmp_path):
    with pytest.raises(ValueError, match="LPS or RAS"):
        read_landmarks(written(tmp_path, "F.fcsv", "1,2,3,4\n"))


@pytest.mark.parametrize(
    "text",
    [
        "name,x,y,z\na,1,2,3\nb,4,5,6\nc,7,8,10\n",
        "a,1,2,3\nb,4,5,6\nc,7,8,10\n",
        "x,y,z,label\n1,2,3,a\n4,5,6,b\n7,8,10,c\n",
        "label,Z,Y,X\na,3,2,1\nb,6,5,4\nc,10,8,7\n",
        "# mm\n1,2,3\n4,5,6\n7,8,10\n",
    ],
)
def test_plain_tables_may_have_names(tmp_path, text):
    path = written(tmp_path, "F.csv", text)
    np.testing.assert_array_equal(read_landmarks(path)[0], POINTS)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.mrk.json", {"markups": markups()["markups"] * 2}, "must have 1 list of markups"),
        ("a.mrk.json", markups("Plane"), "'Plane' are not supported"),
        ("a.mrk.json", markups(frame="IJK"), "frame 'IJK'"),
        ("a.mrk.json", markups(coordinateUnits="um"), "'um', but must be in mm"),
        ("a.mrk.json", markups(controlPoints=[]), "no control points"),
        ("a.mrk.json", markups(controlPoints=[{"label": "P"}]), "'P'.*not a finite position"),
        ("a.mrk.json", markups(controlPoints=[{"position": [1, 2, None]}]), "not a finite position"),
        ("a.mrk.json", markups(controlPoints=[{"positionStatus": "undefined"}]), "status is 'undefined'"),
        ("a.fcsv", "# CoordinateSystem = LPS\n1,2,x,4\n", "line 2"),
        ("a.fcsv", "# CoordinateSystem = LPS\n", "no landmarks"),
    ],
)
def test_what_is_no_list_of_landmarks_is_told(tmp_path, name, content, words):
    with pytest.raises(ValueError, match=words):
        read_landmarks(written(tmp_path, name, content))
