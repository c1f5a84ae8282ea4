"""Presets of PBDDeformer: points on the curve of speed against accuracy."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

#: Points of the front of docs/tradeoff.rst, with ``solver="anderson"``, over 90 degrees of hip flexion in
#: steps of 10: processor time per step of all muscles, RMS distance to the converged solve, and that of each.
#:
#: ========  ============================  ===============================================================
#: preset    phantom hip, three muscles    real hip (LHDL data), four muscles
#: ========  ============================  ===============================================================
#: preview   57 ms, 3.1 mm (at most 3.9)   95 ms, 4.2 mm (maximus 6.8, medius 2.2, iliacus 3.4, adductor 2.6)
#: balanced  178 ms, 0.22 mm (0.29)        1175 ms, 0.55 mm (0.18, 0.17, 0.32, adductor brevis 1.0)
#: accurate  253 ms, 0.03 mm (0.04)        2313 ms, 0.23 mm (0.06, 0.02, 0.03, adductor brevis 0.47)
#: ========  ============================  ===============================================================
#:
#: The converged solve of the adductor brevis is itself known to 0.8 mm only: from 70 degrees on it ends in
#: one of several shapes. The volume is kept to 1e-11 %; 95 of 100 points are not in a bone at all, and
#: none is deeper than 0.11 mm, where it is at rest.
PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "preview": {"iterations": 30, "tolerance": 1.0},
        "balanced": {"iterations": 100, "tolerance": 0.15},
        "accurate": {"iterations": 400, "tolerance": 0.02},
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
