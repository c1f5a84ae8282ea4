"""Landmarks are read in order, each once, and a ring is told from an open curve."""

import json

import numpy as np
import pytest

from vtkmuscle.data.attachments import AttachmentArea, attachments_from
from vtkmuscle.io import read_landmarks, write_polydata
from vtkmuscle.scene.writing import write_areas

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]])
RING = np.vstack([SQUARE, SQUARE[:1]])


def csv(points, head=""):
    return head + "\n".join(",".join(map(repr, map(float, p))) for p in points) + "\n"


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("suffix", [".vtp", ".csv", ".json"])
def test_every_format_gives_landmarks_and_closedness(suffix, closed, tmp_path):
    path = tmp_path / f"area{suffix}"
    points = RING if closed else SQUARE
    if suffix == ".vtp":
        write_polydata(path, attachments_from([AttachmentArea("origin", "b", SQUARE, closed)]).GetBlock(0))
    elif suffix == ".csv":
        path.write_text(csv(points, "# digitised\nx, y, z\n"))
    else:
        path.write_text(json.dumps(points.tolist()))
    landmarks, ring = read_landmarks(path)
    np.testing.assert_array_equal(landmarks, SQUARE)
    assert ring is closed


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "x,y,z\n1,2,3\n1,two,3\n", "a.csv: line 3, '1,two,3', does not begin with three numbers"),
        ("a.csv", "x,y,z\nu,v,w\n1,2,3\n", "line 2, 'u,v,w', does not begin"),
        ("a.csv", "x;y;z\n1,5;2;3\n", "line 2, '1,5;2;3', .*; separate numbers by commas, and write"),
        ("a.csv", "1O,2,3\n4,5,6\n", "line 1, '1O,2,3', does not begin with three numbers"),
        ("a.csv", "1,2\n", "line 1 has fewer than three numbers"),
        ("a.csv", "x,y,z\n", "has no landmarks"),
        ("a.csv", "1,2,nan\n", "landmark 0 has a coordinate that is not finite"),
        ("a.json", "{", "not a JSON list"),
        ("a.json", "[1, 2, 3]", "must hold a list of"),
        ("a.json", '[["a", "b", "c"]]', "not a JSON list"),
        ("a.csv", None, "a.csv: there is no such file"),
        ("a.txt", "1 2 3", "not '.txt'; save it as .csv"),
    ],
)
def test_what_cannot_be_read_is_named(name, text, message, tmp_path):
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(ValueError if text is not None else FileNotFoundError, match=message):
        read_landmarks(tmp_path / name)


@pytest.mark.parametrize("frame", ["LPS", "RAS"])
def test_areas_are_written_as_curves_that_slicer_recognises(frame, tmp_path):
    ends = ("origin", "pelvis", SQUARE, True), ("insertion", "femur", SQUARE, False)
    areas = [AttachmentArea(*end) for end in ends]
    for table, area in zip(write_areas(tmp_path, "iliacus", areas, frame), areas, strict=True):
        content = json.loads((tmp_path / table["landmarks"]).read_text())
        assert "/markups-schema-v1." in content["@schema"]
        assert content["markups"][0]["type"] == ("ClosedCurve" if area.closed else "Curve")
        landmarks, closed = read_landmarks(tmp_path / table["landmarks"], frame=frame)
        np.testing.assert_array_equal(landmarks, SQUARE)
        assert closed is area.closed
