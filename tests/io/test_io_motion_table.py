"""Tables of transforms come back exactly, and every fault is named with its line."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vtkmuscle.core.motion.coordinates import Coordinate
from vtkmuscle.core.motion.rigid import RigidMotion, hinge
from vtkmuscle.io import motion_columns, read_motion_table, write_motion_table

AXES = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda a: np.linalg.norm(a) > 0.1)


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "m.csv"
    write_motion_table(path, hinge("femur", (1, 2, 3), (1, 1, 0), [0, 15, 30]), "femur")
    return path


def changed(table, line, column, value):
    rows = [row.split(",") for row in table.read_text().splitlines()]
    rows[line - 1][rows[0].index(column)] = value
    table.write_text("\n".join(",".join(row) for row in rows) + "\n")


@settings(max_examples=5)
@given(axis=AXES, centre=st.tuples(*[st.floats(-500, 500)] * 3), angle=st.floats(0.001, 170))
def test_a_motion_comes_back_exactly(axis, centre, angle, tmp_path_factory):
    motion = hinge("femur", centre, axis, [0.0, angle])
    path = tmp_path_factory.mktemp("table") / "m.csv"
    write_motion_table(path, motion, "femur")
    again = read_motion_table(path, "femur", time="time", centre=centre)
    np.testing.assert_array_equal(again.times, motion.times)
    np.testing.assert_array_equal(again.transforms["femur"], motion.transforms["femur"])
    np.testing.assert_array_equal(again.centre, motion.centre)


def test_the_last_row_of_the_matrix_may_be_left_out(table):
    rows = [",".join(row.split(",")[:13]) for row in table.read_text().splitlines()]
    assert rows[0].endswith("T23")
    table.write_text("# to rest\n" + "\n\n".join(rows))
    motion = read_motion_table(table, "femur", time="time")
    np.testing.assert_array_equal(motion.transforms["femur"][:, 3], [[0, 0, 0, 1]] * 3)


def test_a_byte_order_mark_and_other_columns_do_no_harm(table):
    rows = table.read_text().splitlines()
    text = "\n".join(["note," + rows[0], *("x," + row for row in rows[1:])])
    table.write_text(text, encoding="utf-8-sig")
    assert read_motion_table(table, "femur", time="time").times.tolist() == [0.0, 15.0, 30.0]
    assert read_motion_table(table, "femur").times.tolist() == [0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    ("line", "column", "value", "message"),
    [
        (3, "T11", "zwei", r"m\.csv: line 3 \(row 1\): T11 is 'zwei', but must be a finite number"),
        (3, "T03", "nan", r"line 3 \(row 1\): T03 is 'nan'"),
        (4, "T00", "1.5", r"line 4 \(row 2\): the transform is not rigid: .* scales or shears"),
        (2, "T00", "-1", r"line 2 \(row 0\): the transform is not rigid: .* mirrors"),
        (2, "T33", "2", r"line 2 \(row 0\): the transform is not rigid: its last row"),
        (4, "time", "15.0", r"line 4 \(row 2\): the times \(time\) must ascend, but 15 comes after 15"),
        (1, "T21", "t21", r"m\.csv: the column\(s\) T21 are missing"),
        (1, "T21", "T20", r"m\.csv: the column\(s\) T20 appear twice"),
        (1, "time", "angle", r"there is no column 'time' for the time; the other columns are: angle"),
    ],
)
def test_faults_are_named_with_their_line(line, column, value, message, table):
    changed(table, line, column, value)
    with pytest.raises(ValueError, match=message):
        read_motion_table(table, "femur", time="time")


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", ""), (b"T00,T01\n", ""), (b"\xff\xfe\x00", ""), (b"T00;T01\n1;0\n", ".* the columns by commas")],
)
def test_a_table_without_rows_or_columns_is_named(content, words, tmp_path):
    (tmp_path / "m.csv").write_bytes(content)
    with pytest.raises(ValueError, match=r"m\.csv: " + words):
        read_motion_table(tmp_path / "m.csv", "femur")


def test_the_angle_of_a_hinge_comes_back_as_a_coordinate(tmp_path):
    motion = hinge("tibia", (1, 2, 3), (0, 0, 1), [0, 10, 25], coordinate="knee_flexion")
    write_motion_table(tmp_path / "knee.csv", motion, "tibia")
    read = read_motion_table(tmp_path / "knee.csv", "tibia", time="time", coordinates=["knee_flexion"])
    assert read.coordinates["knee_flexion"].values.tolist() == [0, 10, 25]
    assert read.coordinates["knee_flexion"].positive == ""
    kinds = {"knee_flexion": {"unit": "rad", "positive": "flexion"}}
    found = read_motion_table(tmp_path / "knee.csv", "tibia", coordinates=kinds).coordinates["knee_flexion"]
    assert (found.unit, found.positive) == ("rad", "flexion")
    assert motion_columns(tmp_path / "knee.csv") == ["time", "knee_flexion"]


@pytest.mark.parametrize(
    ("column", "values", "is_one"),
    [
        ("hip_flexion", [-10, 0, 10], True),
        ("hip_flexion", [0, 1, 2], False),  # counts the rows
        ("hip_flexion", [1, 2, 3], False),
        ("time", [0, 10, 20], False),
        ("Frame", [0, 10, 20], False),
    ],
)
def test_the_time_is_a_coordinate_where_it_is_neither_a_time_nor_a_count(column, values, is_one, tmp_path):
    path = tmp_path / "motion.csv"
    write_motion_table(path, replace(hinge("tibia", (0, 0, 0), (1, 0, 0), values), coordinates={}), "tibia")
    path.write_text(path.read_text().replace("time,", f"{column},"))
    assert list(read_motion_table(path, "tibia", time=column).coordinates) == ([column] if is_one else [])
    assert list(read_motion_table(path, "tibia", coordinates=[column]).coordinates) == [column]
    assert not read_motion_table(path, "tibia").coordinates


def test_columns_that_do_not_change_are_no_coordinates(tmp_path):
    angles, still = Coordinate([0.0, 10.0]), Coordinate([3.0, 3.0])
    motion = replace(
        hinge("b", (0, 0, 0), (1, 0, 0), [0, 10]), coordinates={"flexion": angles, "still": still}
    )
    write_motion_table(tmp_path / "m.csv", motion, "b")
    assert list(read_motion_table(tmp_path / "m.csv", "b", coordinates=["flexion", "still"]).coordinates) == [
        "flexion"
    ]


@pytest.mark.parametrize("name", ["T00", "time", "a,b", " a"])
def test_a_coordinate_of_the_name_of_another_column_is_refused(name, tmp_path):
    motion = replace(hinge("b", (0, 0, 0), (1, 0, 0), [0, 10]), coordinates={name: Coordinate([5.0, 6.0])})
    with pytest.raises(ValueError, match="rename it"):
        write_motion_table(tmp_path / "m.csv", motion, "b")


def test_a_table_of_several_bones_is_read_as_written(tmp_path):
    femur, tibia = (hinge(name, (0, 0, 0), (1, 0, 0), [0, 10, 20]) for name in ("femur", "tibia"))
    moved = {**femur.transforms, "tibia": tibia.transforms["tibia"][[0, 0, 2]]}
    both = RigidMotion(femur.times, moved, None, femur.coordinates)
    path = tmp_path / "bones.csv"
    write_motion_table(path, both)
    again = read_motion_table(path, time="time")
    assert list(again.transforms) == ["femur", "tibia"]
    for name, transforms in both.transforms.items():
        np.testing.assert_array_equal(again.transforms[name], transforms)
    path.write_text(path.read_text().replace("tibia,20.0", "tibia,21.0"))
    with pytest.raises(ValueError, match="the times of the bones 'femur' and 'tibia' differ"):
        read_motion_table(path, time="time")
