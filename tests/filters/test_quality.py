"""Presets of PBDDeformer."""

import pytest

from vtkmuscle.filters import PBDDeformer
from vtkmuscle.filters.deformer.settings import PRESETS


def test_a_preset_is_its_settings_and_explicit_ones_count_more():
    for name, settings in PRESETS.items():
        made = PBDDeformer(quality=name).parameters()
        assert made == {**PBDDeformer().parameters(), "quality": name, **settings}
        assert PBDDeformer(**made).parameters() == made
        deformer = PBDDeformer()
        deformer.quality = name
        assert deformer.parameters() == made
    assert PBDDeformer(quality="accurate", iterations=10).iterations == 10
    assert PBDDeformer(quality=None).parameters() == PBDDeformer().parameters()
    assert PBDDeformer(quality="balanced").parameters() == {
        **PBDDeformer().parameters(),
        "quality": "balanced",
    }


def test_an_unknown_preset_is_refused_with_those_there_are():
    with pytest.raises(
        ValueError, match=r"quality is 'best', but must be one of 'preview', 'balanced', 'acc"
    ):
        PBDDeformer(quality="best")


def test_a_preset_leaves_nothing_of_another():
    assert len({frozenset(settings) for settings in PRESETS.values()}) == 1
    deformer = PBDDeformer(quality="published")
    deformer.quality = "balanced"
    assert deformer.parameters() == PBDDeformer(quality="balanced").parameters()
