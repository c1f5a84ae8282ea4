"""Whether the distance to the end of a solve is within its bound, and how tight the bound is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vtkmuscle.core.types import Floats
from vtkmuscle.tradeoff.study import Row, Study

#: Settings that solve the model of the reference; others go to another shape, which no bound can know of.
GROUPS = ("iterations", "tolerance", "presets")
#: Distances below this are the reference's own uncertainty [mm].
LEAST = 0.005


def estimates(rows: Sequence[Row], muscle: str, *, least: float = LEAST) -> Floats:
    """Return pairs (k, 2) of a true distance and its bound [mm], of settings of the reference's model.

    Others go to another shape, which no bound can know of; distances below ``least`` are the reference's
    own uncertainty, and those at rest are none.
    """
    pairs = [
        (frame["rms_mm"], frame["estimated_mm"])
        for row in rows
        if row.setting.group in GROUPS
        for frame in row.figures["muscles"][muscle]["frames"]
        if frame["estimated_mm"] is not None and frame["rms_mm"] > least and frame["estimated_mm"] > 0.0
    ]
    return np.array(pairs).reshape(-1, 2)


def estimates_in_words(study: Study) -> str:
    """Return in how many frames the bound holds; empty where there is none."""
    pairs = np.vstack([estimates(study.rows, muscle) for muscle in study.muscles])
    if not len(pairs):
        return ""
    ratios = pairs[:, 1] / pairs[:, 0]
    low, middle, high = np.percentile(ratios, (5, 50, 95))
    return (
        f"The true distance is within its bound in {np.mean(ratios >= 1.0):.0%} of {len(pairs)} frames; "
        f"bound / true: {middle:.2g} (median), {low:.2g} to {high:.2g} (5th to 95th percentile)"
    )
