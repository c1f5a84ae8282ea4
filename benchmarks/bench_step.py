"""Measure a whole step of a muscle of the real hip, stage by stage.

Run as ``python benchmarks/bench_step.py [--muscles NAME ...] [--only SETTINGS ...] [--stages]``.
A step is a frame of hip flexion (2 degrees): both bones move and are kept out of, fibres are given, and
carried along as scenes have it. The whole motion is run several times with each of the settings in turn, so
that all see the same machine. Times are of the processor, on one core; of each frame the least counts, so
that no field of a bone is filled in it, and the median over the frames is printed.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from real_hip import data_folder

from vtkmuscle import Scene
from vtkmuscle.core.collision import contact
from vtkmuscle.core.deformation import diffusion, settling
from vtkmuscle.core.mesh import rest_shape
from vtkmuscle.core.paths import sheet, skinning
from vtkmuscle.filters.base.algorithm import Algorithm
from vtkmuscle.filters.bone_motion import BoneMotion
from vtkmuscle.filters.fibre_transport import FibreTransport
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.run import muscle_pipeline

#: The settings that are measured.
SETTINGS: dict[str, dict[str, Any]] = {
    "preview": {"quality": "preview"},
    "balanced": {},
    "accurate": {"quality": "accurate"},
    "published": {"quality": "published", "iterations": 10},
}
STEP, FIBRES, OTHER = "step of PBDDeformer", "fibres", "everything else"
#: What stages are made of: functions by their owner.
STAGES: dict[str, list[tuple[Any, str]]] = {
    "bone motion": [(BoneMotion, "RequestData")],
    "reading inputs": [(PBDDeformer, "_prepare")],
    "paths": [(sheet.MusclePaths, "follow")],
    "skinning": [(skinning.Skinning, "at"), (skinning.SkinnedMuscle, "points")],
    "diffusion": [(diffusion.Diffusion, "spread")],
    "collision": [(contact.Contact, "__init__"), (contact.Contact, "keep_out")],
    "the rest of settling": [(settling.Settling, "settle")],
    "report": [(rest_shape.RestShape, "compare")],
    "result": [(PBDDeformer, "_result"), (Algorithm, "_publish")],
}


class Stopwatch:
    """Adds up the time of stages, each without those within it, frame by frame [ms]."""

    def __init__(self) -> None:
        self._now: dict[str, float] = {}
        self._running: list[str] = []
        self._since = 0.0

    def wrap(self, owner: Any, name: str, stage: str) -> None:
        """Count the time of a method or function as a stage's, from now on."""
        function: Callable[..., Any] = getattr(owner, name)

        def timed(*arguments: Any, **keywords: Any) -> Any:
            with self.measured(stage):
                return function(*arguments, **keywords)

        setattr(owner, name, timed)

    @contextmanager
    def measured(self, stage: str) -> Iterator[None]:
        """Count what happens inside as a stage's."""
        self._switch()
        self._running.append(stage)
        try:
            yield
        finally:
            self._switch()
            self._running.pop()

    def _switch(self) -> None:
        now = time.thread_time()
        if self._running:
            stage = self._running[-1]
            self._now[stage] = self._now.get(stage, 0.0) + 1e3 * (now - self._since)
        self._since = now

    def next_frame(self) -> dict[str, float]:
        """Return the sums of this frame, and begin with the next."""
        done, self._now = self._now, {}
        return done


class Muscle:
    """A muscle of the real hip with its fibres, and what all settings share."""

    def __init__(self, name: str) -> None:
        self.scene = Scene.load(data_folder() / "scene.toml")
        pipeline = muscle_pipeline(self.scene, name)
        self.fixed, self.fibres = pipeline.fixed, pipeline.fibres.update().output

    def chain(self, **settings: Any) -> tuple[PBDDeformer, FibreTransport]:
        """Return the deformer and what carries the fibres; the deformer keeps no frame to go back to."""
        solver = {"checkpoint_memory": 0.0, **settings}
        bones, motion = self.scene.bones_data(), self.scene.motion
        pipeline = MusclePipeline(self.fixed, bones, motion, fibres=self.fibres, solver=solver)
        return pipeline.deformer, pipeline.transport


def measure(
    muscle: Muscle, times: np.ndarray, rounds: int, *, stages: bool, profiled: str | None
) -> dict[str, dict[str, float]]:
    """Return the median over the frames of the least times, by settings and stage [ms]."""
    chains = {name: muscle.chain(**settings) for name, settings in SETTINGS.items()}
    for _, transport in chains.values():
        transport.update(time=times[0])
        transport.update(time=times[1])
    watch = Stopwatch()
    if stages:
        for stage, functions in STAGES.items():
            for owner, name in functions:
                watch.wrap(owner, name, stage)
    profiler = cProfile.Profile(time.thread_time)
    least: dict[str, list[dict[str, float]]] = {name: [{} for _ in times[1:]] for name in chains}
    for name, (deformer, transport) in list(chains.items()) * rounds:
        transport.update(time=times[0])
        watch.next_frame()
        for best, now in zip(least[name], times[1:], strict=True):
            if name == profiled:
                profiler.enable()
            started = time.thread_time()
            with watch.measured(OTHER):
                deformer.update(time=now)
            done = time.thread_time()
            with watch.measured(FIBRES):
                transport.update(time=now)
            profiler.disable()
            sums = {**watch.next_frame(), STEP: 1e3 * (done - started)}
            for stage, ms in sums.items():
                best[stage] = min(best.get(stage, np.inf), ms)
    if profiled:
        pstats.Stats(profiler).sort_stats("tottime").print_stats(40)
    return {
        name: {stage: float(np.median([f.get(stage, 0.0) for f in frames])) for f in frames for stage in f}
        for name, frames in least.items()
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--muscles", nargs="+", default=["adductor_brevis"])
    parser.add_argument("--frames", type=int, default=46)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", nargs="+", choices=SETTINGS, help="settings to measure")
    parser.add_argument("--stages", action="store_true", help="print what each step is made of")
    parser.add_argument("--profile", choices=SETTINGS, help="print what the steps of these settings call")
    arguments = parser.parse_args()
    for name in set(SETTINGS) - set(arguments.only or SETTINGS):
        del SETTINGS[name]
    for name in arguments.muscles:
        muscle = Muscle(name)
        times = muscle.scene.motion.times[: arguments.frames]
        report(
            name,
            measure(muscle, times, arguments.rounds, stages=arguments.stages, profiled=arguments.profile),
            stages=arguments.stages,
        )


def report(muscle: str, measured: dict[str, dict[str, float]], *, stages: bool) -> None:
    """Print what was measured of a muscle."""
    print(f"{muscle}, both bones; ms")
    print(f"  {'':28s} {'step':>7s} {'fibres':>7s} {'whole':>7s}")
    for name, ms in measured.items():
        print(f"  {name:28s} {ms[STEP]:7.2f} {ms[FIBRES]:7.2f} {ms[STEP] + ms[FIBRES]:7.2f}")
    print("  (aim for the last column: adductor brevis 6 ms, gluteus maximus 12 ms)")
    if stages:
        print(f"\n  {'stage, ms':28s}" + "".join(f" {name[:20]:>20s}" for name in measured))
        for stage in [*STAGES, OTHER]:
            row = "".join(f" {ms.get(stage, 0.0):20.2f}" for ms in measured.values())
            print(f"  {stage:28s}{row}")


if __name__ == "__main__":
    main()
