"""What structures are, by the names of MuscleMap and TotalSegmentator, and as people write them."""

import pytest

from vtkmuscle.data.anatomy import plain_name, side_of
from vtkmuscle.labels.reading import kind_of, name_table


@pytest.mark.parametrize(
    ("name", "plain", "kind", "side"),
    [
        ("Left Gluteus Maximus", "gluteus_maximus_left", "muscle", "left"),
        ("femur_r", "femur_right", "bone", "right"),
        ("R-Fémur", "femur_right", "bone", "right"),
        ("rectus femoris", "rectus_femoris", "muscle", None),
        ("vertebrae_L5", "vertebrae_l5", "bone", None),
        ("iliac_vena_left", "iliac_vena_left", None, "left"),
        ("brachiocephalic_trunk", "brachiocephalic_trunk", None, None),
        ("Left", "left", None, "left"),
        ("RightThigh", "thigh_right", "bone", "right"),
        ("leg_lt", "leg_left", "bone", "left"),
    ],
)
def test_a_name_says_what_it_is(name, plain, kind, side):
    assert (plain_name(name), kind_of(name), side_of(name)) == (plain, kind, side)


def test_all_of_musclemap_is_known():
    bones = {"femur", "fibula", "ilium", "patella", "sacrum", "tibia"}
    for name in name_table("musclemap").values():
        stem = plain_name(name).removesuffix("_left").removesuffix("_right")
        assert kind_of(name) == ("bone" if stem in bones else "muscle"), name


def test_muscles_and_bones_of_totalsegmentator_are_known():
    for table in ("thigh_shoulder_muscles", "abdominal_muscles"):
        assert {kind_of(name) for name in name_table(table).values()} == {"muscle"}, table
    assert {kind_of(name) for name in name_table("appendicular_bones").values()} == {"bone"}
    assert len([name for name in name_table("total").values() if kind_of(name) == "muscle"]) == 10
