"""Settings that change nothing in a scene, or are too large; see :mod:`vtkmuscle.scene.sense`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from vtkmuscle.data.attachments import VIA
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.scene.anatomy import Anatomy
from vtkmuscle.scene.data import SceneData

#: A muscle farther from its bones than this is not on them [mm].
CLEARANCE = 10.0


def settings_findings(scene: SceneData, anatomy: Anatomy) -> Iterator[tuple[str, str, str, bool]]:
    """Give the fields of a finding for each setting that cannot be meant."""
    for table, kind in (("solver", PBDDeformer), ("fixing", FixedPointDetector)):
        idle: dict[str, list[str]] = {}
        for name, muscle in scene.muscles.items():
            own, given = getattr(muscle, table), getattr(scene, f"{table}_of")(name)
            reasons = dict(_idle(kind, given))
            if table == "fixing":
                reasons |= _idle_distance(scene, name)
            for setting in own.keys() & reasons.keys():
                yield _finding(f"muscles.{name}.{table}.{setting}", reasons[setting])
            for setting in getattr(scene, table).keys() & (reasons.keys() | own.keys()):
                idle.setdefault(setting, []).append(reasons.get(setting, "every muscle has its own"))
        for setting, found in idle.items():
            if len(found) == len(scene.muscles):
                yield _finding(f"{table}.{setting}", found[0])
    for name, muscle in scene.muscles.items():
        clearance = scene.millimetres * scene.solver_of(name).get("bone_clearance", 0.0)
        if clearance > CLEARANCE:
            key = f"muscles.{name}.solver" if "bone_clearance" in muscle.solver else "solver"
            size = scene.millimetres * float(np.ptp(anatomy.muscles[name].points, axis=0).max())
            problem = f"{name!r} is kept {clearance:.3g} mm away from the bones"
            yield f"{key}.bone_clearance", problem, f"give at most {CLEARANCE:g} mm", clearance > size


def _finding(key: str, reason: str) -> tuple[str, str, str, bool]:
    return key, f"it changes nothing: {reason}", "leave it out", False


def _idle(kind: type[Filter], given: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Give the settings of a filter that say nothing beside the others, and why."""
    values = kind(**given).parameters()
    for name in given:
        declared = kind.parameter_declarations[name]
        if not declared.counts_with(values):
            yield name, declared.condition.strip().removesuffix(".").lower()
    if kind is PBDDeformer and "dt" in given and not any(values["external_force"]):
        yield "dt", "without external_force a step of any time is the same"


def _idle_distance(scene: SceneData, name: str) -> dict[str, str]:
    given = scene.fixing_of(name)
    method = given.get("method", FixedPointDetector.parameter_declarations["method"].default)
    if "distance" not in given or method == "proximity":
        return {}
    if method == "attachment" and any(
        not one.closed and one.role != VIA for one in scene.muscles[name].attachments
    ):
        return {}
    return {"distance": "it is for the method 'proximity', and for areas that are open curves"}
