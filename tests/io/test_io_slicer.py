"""Landmarks of 3D Slicer and in .nrrd: frames, names, rings, and refused lists."""

import gzip
import json

import numpy as np
import pytest

from vtkmuscle.io import read_landmarks, read_named_points

POINTS = [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 10.0]]
NRRD = "NRRD0004\ntype: double\nsizes: 3 3\nencoding: raw\n\nabc"
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
    text = content if isinstance(content, str | bytes) else json.dumps(content)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


@pytest.mark.parametrize(("frame", "expected"), [("LPS", POINTS), ("RAS", OTHER_SIDE)])
def test_markups_are_turned_to_the_frame_of_the_scene(tmp_path, frame, expected):
    path = written(tmp_path, "F.mrk.json", markups(frame=frame))
    points, closed = read_landmarks(path)
    np.testing.assert_array_equal(points, expected)
    assert not closed
    np.testing.assert_array_equal(read_landmarks(path, frame=frame)[0], POINTS)
    assert read_named_points(path).names == ("F-0", "F-1", "F-2")


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


@pytest.mark.parametrize("encoding", ["raw", "gzip", "ascii"])
def test_nrrd_lists_of_all_encodings_are_the_same(tmp_path, encoding):
    head = "NRRD0004\n# made\ntype: double\ndimension: 2\nspace: RAS\nsizes: 3 3\nendian: little\n"
    head += f"encoding: {encoding}\n\n"
    body = np.array(POINTS, dtype="<f8").tobytes()
    if encoding == "gzip":
        body = gzip.compress(body)
    elif encoding == "ascii":
        body = " ".join(str(value) for row in POINTS for value in row).encode()
    path = written(tmp_path, "F.nrrd", head.encode() + body)
    np.testing.assert_array_equal(read_landmarks(path)[0], OTHER_SIDE)


@pytest.mark.parametrize("line", ["\n", "\r\n"])
def test_bytes_of_nrrd_numbers_that_end_lines_elsewhere_are_numbers(tmp_path, line):
    points = np.frombuffer(b"\r\n\r\n\n\n\x14@" * 9, dtype="<f8").reshape(3, 3)
    head = line.join(["NRRD0004", "type: double", "sizes: 3 3", "endian: little", "encoding: raw", "", ""])
    path = written(tmp_path, "F.nrrd", head.encode() + points.tobytes() + b"\n")  # with a byte too many
    np.testing.assert_array_equal(read_landmarks(path)[0], points)


@pytest.mark.parametrize(
    "text",
    [
        "name,x,y,z\na,1,2,3\nb,4,5,6\nc,7,8,10\n",
        "a,1,2,3\nb,4,5,6\nc,7,8,10\n",
        "x,y,z,label\n1,2,3,a\n4,5,6,b\n7,8,10,c\n",
        "label,l,p,s,defined\na,1,2,3,1\nb,4,5,6,1\nc,7,8,10,1\n",
        "label,R,A,S,defined\na,-1,-2,3,1\nb,-4,-5,6,1\nc,-7,-8,10,1\n",
        "label,Z,Y,X\na,3,2,1\nb,6,5,4\nc,10,8,7\n",
        "# mm\n1,2,3\n4,5,6\n7,8,10\n",
    ],
)
def test_plain_tables_may_have_names(tmp_path, text):
    np.testing.assert_array_equal(read_landmarks(written(tmp_path, "F.csv", text))[0], POINTS)


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
        ("a.csv", ",0,1,2\n0,1.5,2,3\n1,4,5,6\n", "line 2 has 4 numbers, and no column is named x, y or z"),
        ("a.fcsv", "# CoordinateSystem = LPS\n1,2,x,4\n", "line 2"),
        ("a.fcsv", "# CoordinateSystem = LPS\n", "no landmarks"),
        ("a.nrrd", "PNG", "not NRRD"),
        ("a.nrrd", NRRD.replace("3 3", "10 10 10"), "not an image"),
        ("a.nrrd", NRRD, "0 numbers, but the header says 9"),
        ("a.nrrd", NRRD + 80 * "a", "10 numbers, but the header says 9"),
        ("a.nrrd", NRRD.replace("raw", "gzip"), "damaged"),
        ("a.nrrd", NRRD.replace("raw", "text"), "damaged"),
        ("a.nrrd", NRRD.replace("raw", "bzip2"), "encoding: 'bzip2' is not supported"),
        ("a.nrrd", NRRD.replace("raw\n", "raw\nbyte skip: 4\n"), "byteskip: '4' is not supported"),
        ("a.nrrd", NRRD.replace("raw\n", "raw\ndata file: /etc/passwd\n"), "'/etc/passwd' is not supported"),
    ],
)
def test_what_is_no_list_of_landmarks_is_told(tmp_path, name, content, words):
    with pytest.raises(ValueError, match=words):
        read_landmarks(written(tmp_path, name, content))
