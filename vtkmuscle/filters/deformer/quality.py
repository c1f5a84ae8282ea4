"""Presets of PBDDeformer: points on the curve of speed against accuracy."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

#: Points of the front of docs/tradeoff.rst, over 90 degrees of hip flexion in steps of 10: processor time per
#: step of all muscles, RMS distance to the converged solve, and that of each.
#:
#: ========  ==============================  ===========================================================
#: preset    phantom hip, three muscles      real hip (LHDL data), four muscles
#: ========  ==============================  ===========================================================
#: preview   47 ms, 0.14 mm (at most 0.18)   216 ms, 0.92 mm (maximus 1.3, medius 0.54, iliacus 0.69,
#:                                           adductor brevis 0.91)
#: balanced  65 ms, 0.042 mm (0.058)         395 ms, 0.23 mm (0.28, 0.19, 0.15, 0.27)
#: accurate  88 ms, 0.005 mm (0.007)         729 ms, 0.044 mm (0.075, 0.013, 0.018, 0.040)
#: ========  ==============================  ===========================================================
#:
#: The converged solve itself is known to 0.03 mm. The volume is kept to 1e-10 %; 95 of 100 points are not in
#: a bone at all, and none is deeper than 0.11 mm, where it is at rest.
PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "preview": {"iterations": 30, "tolerance": 0.5},
        "balanced": {"iterations": 60, "tolerance": 0.15},
        "accurate": {"iterations": 200, "tolerance": 0.05},
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
