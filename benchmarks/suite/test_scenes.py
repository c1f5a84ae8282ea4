"""Whole scenes: muscles, fibres, measures, by every deformer and preset."""

from __future__ import annotations

import pytest

from vtkmuscle.filters.deformer import PRESETS
from vtkmuscle.filters.taut_paths import PATH_PRESETS

FEW = 3


@pytest.mark.parametrize(
    ("deformer", "quality"),
    [("paths", None), *(("paths", name) for name in PATH_PRESETS), *(("pbd", name) for name in PRESETS)],
)
def test_phantom_hip_over_3_frames(measured, hip, deformer, quality):
    measured(lambda: hip.scene(2, deformer=deformer, quality=quality), rounds=FEW)
