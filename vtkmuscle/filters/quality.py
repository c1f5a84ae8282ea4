"""Presets of PBDDeformer: points on the curve of speed against accuracy."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

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
