"""Motion files of OpenSim and SIMM: their headers, units and faults."""

import numpy as np
import pytest

from vtkmuscle.joints.tree import JointCoordinate, KinematicTree
from vtkmuscle.opensim import read_motion_file

TREE = KinematicTree("g", [], [JointCoordinate("knee"), JointCoordinate("tx", "m")])
NEW = "walk\nversion=1\nnRows=2\nnColumns=3\ninDegrees={}\n\nSome words: inDegrees\n\nendheader\n"
ROWS = "time\tknee\ttx\n0\t90\t0.5\n0.1\t180\t0.6\n"


def written(tmp_path, text, name="walk.mot"):
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("header", "in_degrees"),
    [
        (NEW.format("yes"), True),
        (NEW.format("no"), False),
        ("name walk\ndatacolumns 3\ndatarows 2\notherdata 1\nrange 0.0 0.1\nendheader\n", True),
        ("inDegrees=no\t\t\nDataType=double\nversion=3\nOpenSimVersion=4.6\nendheader\n", False),
    ],
)
def test_all_headers_give_the_same_rows(tmp_path, header, in_degrees):
    found = read_motion_file(written(tmp_path, header + ROWS))
    assert found.times.tolist() == [0.0, 0.1]
    values, expected = found.values(TREE), np.array([90.0, 180.0])
    np.testing.assert_allclose(values["knee"], np.radians(expected) if in_degrees else expected)
    np.testing.assert_array_equal(values["tx"], [0.5, 0.6])


def test_a_csv_begins_with_its_labels_and_has_degrees(tmp_path):
    """It was refused for the lack of 'endheader'."""
    rows = "\ufefftime, knee,tx\r\n" + ROWS.partition("\n")[2].replace("\t", ",")
    found = read_motion_file(written(tmp_path, rows, "walk.csv"))
    assert found.times.tolist() == [0.0, 0.1]
    np.testing.assert_allclose(found.values(TREE)["knee"], np.radians([90.0, 180.0]))


def test_rows_are_counted_and_not_believed(tmp_path):
    path = written(tmp_path, NEW.format("yes").replace("nRows=2", "nRows=51") + ROWS)
    with pytest.warns(UserWarning, match=r"nrows=51, but the file has 2 rows"):
        assert len(read_motion_file(path).times) == 2


def test_columns_of_states_are_found_by_their_path(tmp_path):
    labels = "time\t/jointset/k/knee/value\t/jointset/k/knee/speed\n0\t1\t7\n"
    values = read_motion_file(written(tmp_path, "inDegrees=no\nendheader\n" + labels)).values(TREE)
    assert values["knee"].tolist() == [1.0]


def test_other_columns_may_share_a_label_and_coordinates_not(tmp_path):
    text = "inDegrees=no\nendheader\ntime\tknee\tfx\tfx\n0\t1\t2\t3\n"
    assert read_motion_file(written(tmp_path, text)).values(TREE)["knee"].tolist() == [1.0]
    path = written(tmp_path, text.replace("fx\tfx", "fx\tknee"))
    with pytest.raises(ValueError, match="two columns are the coordinate 'knee'"):
        read_motion_file(path).values(TREE)


def test_a_new_file_that_does_not_say_its_unit_is_asked_for_it(tmp_path):
    found = read_motion_file(written(tmp_path, "version=1\nendheader\n" + ROWS))
    with pytest.raises(ValueError, match="inDegrees=yes"):
        found.values(TREE)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "endheader"),
        ("a\nendheader\n", "labels"),
        ("a\nendheader\ntime\tknee\n", "no rows"),
        ("a\nendheader\ntime\tknee\n0\t1\t2\n", "line 4 has 3 numbers"),
        ("a\nendheader\ntime\tknee\n0\tx\n", "'knee' is 'x'"),
        ("a\nendheader\ntime\tknee\n0\tnan\n", "finite"),
        ("a\nendheader\ntime\tknee\n1\t1\n0\t1\n", "line 5: time 0 comes after 1"),
        ("DataType=Vec3\nendheader\ntime\tknee\n1\t1\n", "Vec3"),
        ("inDegrees=perhaps\nendheader\ntime\tknee\n1\t1\n", "yes or no"),
        ("a\nendheader\nframe\tknee\n1\t1\n", "must be time"),
    ],
)
def test_what_is_no_motion_is_told_with_its_line(tmp_path, text, words):
    with pytest.raises(ValueError, match=words):
        read_motion_file(written(tmp_path, text))
