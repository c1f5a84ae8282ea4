"""Published numbers are found by the names that people use, and each has a source."""

import pytest

from vtkmuscle.data import anatomy
from vtkmuscle.data.anatomy import published, published_arm, published_coordinate


@pytest.mark.parametrize(
    ("name", "muscle"),
    [
        ("semimembranosus", "semimembranosus"),
        ("semimem_r", "semimembranosus"),
        ("Semimembranosus left", "semimembranosus"),
        ("M. biceps femoris caput longum", "biceps_femoris_long"),
        ("Right Biceps Femoris Long Head", "biceps_femoris_long"),
        ("peroneus_brevis", "fibularis_brevis"),
        ("glmax1_l", "gluteus_maximus"),
        ("psoas_major_left", "psoas"),
    ],
)
def test_a_muscle_is_found_by_its_usual_names(name, muscle):
    assert published(name).muscle == muscle


@pytest.mark.parametrize("name", ["spindle", "medius", "long", "strap", "", "muscle", "rectus_abdominis"])
def test_other_names_are_unknown(name):
    assert published(name) is None


def test_a_whole_muscle_has_the_range_of_its_parts():
    parts = [published(f"deltoid_{part}", "pennation") for part in ("acromial", "clavicular", "spinal")]
    whole = published("deltoid_r", "pennation")
    assert (whole.low, whole.high) == (min(p.low for p in parts), max(p.high for p in parts))
    arms = [published(name, "moment_arm", "hip_flexion") for name in ("iliacus", "psoas", "iliopsoas")]
    assert arms[2].high == max(arms[0].high, arms[1].high)
    assert published_arm("iliacus_l", "hip_flexion_l") == arms[0] == published_arm("iliacus", "hip_flexion_l")
    assert published_arm("iliacus_left", "hip_flexion_r") is None


@pytest.mark.parametrize(
    ("name", "positive", "expected"),
    [
        ("knee_angle_r", "flexion", ("knee_flexion", 1.0)),
        ("knee_flexion", "", ("knee_flexion", 1.0)),
        ("knee_extension_l", "", ("knee_flexion", -1.0)),
        ("hip_abduction", "abduction", ("hip_adduction", -1.0)),
        ("hip_rotation_r", "external rotation", ("hip_rotation", -1.0)),
        ("ankle_angle_r", "dorsiflexion", ("ankle_dorsiflexion", 1.0)),
        ("knee_angle", "", ("", 0.0)),
        ("femur_angle", "right-handed about (1, 0, 0)", ("", 0.0)),
    ],
)
def test_a_coordinate_is_found_by_joint_and_direction(name, positive, expected):
    assert published_coordinate(name, positive) == expected


def test_each_number_has_a_unit_and_a_source():
    rows = [row for _, row in anatomy._table()]
    assert len(rows) > 500
    assert all(row.low <= row.high and row.unit and row.source for row in rows)
    assert {row.quantity for row in rows} == {
        *("moment_arm", "fibre_length", "pennation", "pcsa", "greatest_force", "fibre_to_path", "path_length")
    }
    for row in rows:  # the hamstrings flex the knee, the vasti extend it
        if row.coordinate == "knee_flexion" and row.muscle.startswith(("semi", "biceps_f", "vastus")):
            assert row.low * row.high > 0.0
            assert (row.high > 0.0) == (not row.muscle.startswith("vastus"))
