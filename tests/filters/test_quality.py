"""Presets and the number of triangles of PBDDeformer."""

import pytest

from vtkmuscle.filters import BoneMotion, FixedPointDetector, PBDDeformer
from vtkmuscle.filters.deformer.settings import PRESETS
from vtkmuscle.phantoms import spindle_over_hinge


@pytest.fixture(scope="module")
def deformer_of():
    phantom = spindle_over_hinge()
    ((name, muscle),) = phantom.muscles.items()
    fixed = FixedPointDetector()(muscle, phantom.bones, phantom.attachments[name])
    moving = BoneMotion(motion=phantom.motion)
    moving.connect(0, phantom.bones)

    def make(**parameters):
        deformer = PBDDeformer(**parameters)
        deformer.connect(0, fixed)
        deformer.connect(1, moving)
        return deformer

    make.times, make.fixed, make.motion = phantom.motion.times, fixed, phantom.motion
    return make


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
