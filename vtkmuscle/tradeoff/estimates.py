"""How well the estimated distance to the end of a solve tells the true one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.tradeoff.study import Row, Study

Floats = NDArray[np.float64]

#: Settings that solve the model of the reference; others go to another shape, which no estimate can know of.
GROUPS = ("iterations", "tolerance", "presets")
#: Distances below this are the reference's own uncertainty [mm].
LEAST = 0.005


def estimates(rows: Sequence[Row], muscle: str, *, least: float = LEAST) -> Floats:
    """Return pairs (k, 2) of true and estimated distance [mm], of settings that solve the reference's model.

    Others go to another shape, which no estimate can know of; distances below ``least`` are the reference's
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
    """Return in how many frames the estimate is within a factor of 2; empty where there is none."""
    pairs = np.vstack([estimates(study.rows, muscle) for muscle in study.muscles])
    if not len(pairs):
        return ""
    ratios = pairs[:, 1] / pairs[:, 0]
    within = np.mean((ratios >= 0.5) & (ratios <= 2.0))
    low, middle, high = np.percentile(ratios, (5, 50, 95))
    return (
        f"The estimated distance is within a factor of 2 of the true one in "
        f"{within:.0%} of {len(pairs)} frames; "
        f"estimated / true: {middle:.2g} (median), {low:.2g} to {high:.2g} (5th to 95th percentile)"
    )
