"""Presets of PBDDeformer: points on the curve of speed against accuracy."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

#: Measured on the phantom hip in steps of 10 degrees, all three muscles, by
#: ``vtkmuscle tradeoff demo --every 5 --frames 0:10 --only presets``: processor time per step, and RMS
#: distance to the converged solve, of all muscles and of the worst: ``preview`` 91 ms, 3.1 and 3.9 mm;
#: ``balanced`` 245 ms, 0.20 and 0.29 mm; ``accurate`` 346 ms, 0.03 and 0.04 mm, which is as much as the
#: converged solve is uncertain by. The volume is kept to 1e-12, points end at most 0.04 mm in a bone.
PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "preview": {"iterations": 25, "max_triangles": 1000},
        "balanced": {"iterations": 400, "tolerance": 0.3},
        "accurate": {"iterations": 1000, "tolerance": 0.05},
    }
)


def with_preset(quality: str | None, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return settings on top of those of a preset.

    Parameters
    ----------
    quality : str or None
        Name of the preset; None for none.
    settings : mapping
        What is given explicitly: it counts more.

    Raises
    ------
    ValueError
        If there is no such preset.
    """
    if quality is None:
        return dict(settings)
    if quality not in PRESETS:
        allowed = ", ".join(map(repr, PRESETS))
        raise ValueError(f"PBDDeformer.quality is {quality!r}, but must be one of {allowed} or None")
    return {**PRESETS[quality], **settings}
