"""Qualities of PBDDeformer: points on the front of cost against smoothness, and the published model."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from vtkmuscle.core.paths.sheet import POINTS

#: Name of the quality that is Algorithm 2 of Kohout, Cervenka 2021, doi:10.1007/978-3-030-72379-8_24.
PUBLISHED = "published"

#: What each quality sets of PBDDeformer's parameters.
PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "preview": {"collision": "sdf", "iterations": 2, "taut_resolution": 24},
        "balanced": {"collision": "sdf", "iterations": 5, "taut_resolution": POINTS - 1},
        "accurate": {"collision": "sdf", "iterations": 20, "taut_resolution": 2 * (POINTS - 1)},
        PUBLISHED: {"collision": "voxel", "iterations": 30},
    }
)
