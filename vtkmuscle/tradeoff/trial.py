"""One setting tried on a scene: a run of the scene with it."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import points_of
from vtkmuscle.run import RunOptions, run_scene
from vtkmuscle.scene.data import Muscle, SceneData
from vtkmuscle.tradeoff.settings import Setting

#: Parameters of PBDDeformer that trade speed for accuracy. The scene's own values of these do not count, so
#: that the reference is the reference; all others are the scene's.
TRADED = ("quality", "collision", "iterations", "taut_resolution")

#: Part of the frames left out at either end of their times, in the mean.
_TRIMMED = 0.1


@dataclass(eq=False)
class Trial:
    """The results of one muscle.

    Attributes
    ----------
    points : (f, n, 3) array
        In the frames that are compared [mm].
    lengths : (f, k) array
        Of the fibres in these frames [mm]; k is 0 for a muscle without fibres.
    frames : list of dict
        The report's figures of these frames.
    ms, fibre_ms : float
        Processor time of a frame: deforming the muscle, and carrying and measuring its fibres.
    fill_s : float
        Processor time of filling it with fibres [s].
    """

    points: Floats
    lengths: Floats
    frames: list[dict[str, Any]]
    ms: float
    fibre_ms: float
    fill_s: float


def tried(
    scene: SceneData,
    setting: Setting,
    compared: Sequence[int],
    muscles: Sequence[str],
    *,
    iterations: Mapping[str, int] | None = None,
) -> dict[str, Trial | None]:
    """Run a scene with a setting, and return the results of these muscles, None of those that failed.

    Frames up to the last that is compared are computed. Other muscles are run as well where muscles may meet.
    ``iterations`` of single muscles count more than the setting's.
    """
    own = iterations or {}
    needed = scene.muscles if scene.muscle_contact != "off" else muscles
    changed = replace(
        scene,
        motion=thinned(scene.motion, setting.every, compared[-1]),
        quality=scene.quality if setting.solver is None else None,
        solver=_traded(scene.solver, setting.solver),
        muscles={name: _with(scene.muscles[name], setting, own.get(name)) for name in needed},
    )
    # All muscles in one thread, one after the other: so the processor's time of a stage is the muscle's own.
    options = RunOptions(workers=1, sense=False, clock=time.process_time)
    result = run_scene(changed, None, options)
    times = [float(scene.motion.times[number]) for number in compared]
    kept = [i for i, at in enumerate(result.times) if at in times]
    trials: dict[str, Trial | None] = {}
    for name in muscles:
        report = result.report["muscles"][name]
        rows = report["frames"]
        if len(rows) < len(result.times):
            trials[name] = None
            continue
        lengths = result.fibre_lengths.get(name, np.empty((len(rows), 0)))
        trials[name] = Trial(
            np.array([points_of(result.muscle(name, time=result.times[i])) for i in kept])
            * scene.millimetres,
            lengths[kept],
            [rows[i] for i in kept],
            # The first frame makes what the others use.
            trimmed_mean([row["ms"] for row in rows[1:] or rows]),
            trimmed_mean([row.get("ms_fibres", 0.0) for row in rows[1:] or rows]),
            report["seconds"].get("fibres", 0.0),
        )
    return trials


def _traded(own: Mapping[str, Any], new: Mapping[str, Any] | None) -> dict[str, Any]:
    if new is None:
        return dict(own)
    return {**{name: own[name] for name in own if name not in TRADED}, **new}


def _with(muscle: Muscle, setting: Setting, iterations: int | None) -> Muscle:
    solver = _traded(muscle.solver, setting.solver)
    if iterations is not None:
        solver["iterations"] = iterations
    fibres = None if muscle.fibres is None else {**muscle.fibres, **setting.fibres}
    return replace(muscle, solver=solver, fibres=fibres)


def thinned(motion: RigidMotion, every: int, last: int) -> RigidMotion:
    """Return each frame of a motion whose number ``every`` divides, and the last one in any case."""
    return motion.part(sorted({*range(0, last + 1, every), last}))


def trimmed_mean(values: Sequence[float]) -> float:
    """Return the mean of values without the tenth at either end: what else the machine does is in those."""
    ordered = np.sort(np.asarray(values))
    cut = int(_TRIMMED * len(ordered))
    return float(ordered[cut : len(ordered) - cut].mean())
