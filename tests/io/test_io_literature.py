"""Published moment arms come back as they are, and every fault is named with its line."""

from dataclasses import fields, replace

import numpy as np
import pytest

from vtkmuscle.io import curves_for, read_literature, write_literature
from vtkmuscle.io.literature import drawn_curves

TABLE = """# where it is from
source,muscle,part,dof,angle_deg,moment_arm_mm,note
A1985,psoas,,hip_flexion,10,31.5,digitised
A1985,psoas,,hip_flexion,0,30,

B2005,psoas,fibres_lower_bound,hip_flexion,0,20,"a, b"
B2005,psoas,fibres_upper_bound,hip_flexion,0,40,
B2005,gluteus,,hip_rotation,0,-4,
"""


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "published.csv"
    path.write_text(TABLE)
    return path


def test_each_source_and_part_is_a_curve_by_ascending_angle(path):
    first, lower, upper, other = read_literature(path)
    assert (first.source, first.muscle, first.dof, first.part) == ("A1985", "psoas", "hip_flexion", "")
    assert (first.angles.tolist(), first.arms.tolist()) == ([0, 10], [30, 31.5])
    assert (lower.part, upper.part) == ("fibres_lower_bound", "fibres_upper_bound")
    assert (other.dof, other.arms.tolist()) == ("hip_rotation", [-4])
    for by in (0.0, 9.0):  # sides of a single angle, or of different angles, enclose no area
        above = replace(upper, angles=upper.angles + by)
        assert [curve.upper for curve in drawn_curves((lower, above))] == [None, None]


def test_what_is_written_is_read_back(path, tmp_path):
    curves = read_literature(path)
    write_literature(tmp_path / "again.csv", curves)
    for curve, again in zip(curves, read_literature(tmp_path / "again.csv"), strict=True):
        for field in fields(curve):
            np.testing.assert_array_equal(getattr(curve, field.name), getattr(again, field.name))


def test_a_side_need_not_be_named(path):
    curves = read_literature(path)
    assert len(curves_for(curves, muscle="psoas_r", coordinate="hip_flexion_l")) == 3
    assert len(curves_for(curves, coordinate="hip_rotation")) == 1
    assert not curves_for(curves, muscle="psoas", coordinate="hip")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("angle_deg", "angle", r"column\(s\) angle_deg are missing; published moment arms have"),
        ("10,31.5", "ten,31.5", "line 3: angle_deg is 'ten', but must be a finite number"),
        ("0,30,", "0,inf,", "line 4: moment_arm_mm is 'inf'"),
        ("A1985,psoas,,hip_flexion,10", "A1985,,,hip_flexion,10", "line 3: muscle is empty"),
        ("0,-4,", "0,-4", "line 8 has 6 cells, but the header has 7"),
    ],
)
def test_a_fault_is_named(old, new, message, path):
    path.write_text(TABLE.replace(old, new, 1))
    with pytest.raises(ValueError, match=message):
        read_literature(path)


def test_an_empty_table_and_no_table_are_told(tmp_path):
    (tmp_path / "empty.csv").write_text(TABLE[: TABLE.index("A1985")])
    with pytest.raises(ValueError, match="the table has no rows"):
        read_literature(tmp_path / "empty.csv")
    with pytest.raises(FileNotFoundError):
        read_literature(tmp_path / "no.csv")
