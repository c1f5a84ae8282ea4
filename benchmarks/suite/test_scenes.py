"""Whole scenes: muscles, fibres, measures, by every preset."""

from __future__ import annotations

import pytest

from vtkmuscle.filters.deformer.settings import PRESETS

FEW = 3


@pytest.mark.parametrize("quality", [None, *PRESETS])
def test_phantom_hip_over_3_frames(measured, hip, quality):
    measured(lambda: hip.scene(2, quality=quality), rounds=FEW)
