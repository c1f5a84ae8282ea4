"""Measure a whole step of a muscle of the real hip, stage by stage.

Run as ``python benchmarks/bench_step.py [--muscles NAME ...] [--only SETTINGS ...] [--stages]``.
A step is a frame of hip flexion (2 degrees): both bones move and are kept out of, fibres are given, and
carried along as scenes have it. The whole motion is run several times with each of the settings in turn, so
that all see the same machine. Times are of the processor, on one core; of each frame the least counts, so
that no field of a bone is filled in it, and the median over the frames is printed. ``--stages`` prints for
each filter of the chain the time within ``execute``, and what the filter and the pipeline add to it.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

import numpy as np
from real_hip import data_folder
from stage_times import StageTimes

from vtkmuscle import Scene
from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.run import muscle_pipeline

#: The settings that are measured.
SETTINGS: dict[str, dict[str, Any]] = {
    "preview": {"quality": "preview"},
    "balanced": {},
    "accurate": {"quality": "accurate"},
    "pbd": {"deformer": "pbd"},
    "published": {"deformer": "pbd", "quality": "published", "solver": {"iterations": 10}},
}
STEP, FIBRES = "step", "fibres"


class Muscle:
    """A muscle of the real hip with its fibres, and what all settings share."""

    def __init__(self, name: str) -> None:
        self.scene = Scene.load(data_folder() / "scene.toml")
        pipeline = muscle_pipeline(self.scene, name)
        self.fixed, self.fibres = pipeline.fixed, pipeline.fibres.update().output

    def chain(self, **settings: Any) -> MusclePipeline:
        """Return the chain; no pose is kept to go back to."""
        bones, motion = self.scene.bones_data(), self.scene.motion
        pipeline = MusclePipeline(self.fixed, bones, motion, fibres=self.fibres, **settings)
        stage = pipeline.deformer if pipeline.taut_paths is None else pipeline.taut_paths
        stage.checkpoint_memory = 0.0
        return pipeline


def measure(chains: dict[str, MusclePipeline], times: np.ndarray, rounds: int) -> dict[str, dict[str, float]]:
    """Return the least time of each part, the median over the frames [ms]."""
    for chain in chains.values():
        chain.metrics.update(time=times[0])
        chain.metrics.update(time=times[1])
    least = {name: np.full((len(times) - 1, 2), np.inf) for name in chains}
    for name, chain in list(chains.items()) * rounds:
        chain.metrics.update(time=times[0])
        for best, now in zip(least[name], times[1:], strict=True):
            clock = [time.thread_time()]
            for part in (chain.deformer, chain.metrics):
                part.update(time=now)
                clock.append(time.thread_time())
            np.minimum(best, 1e3 * np.diff(clock), out=best)
    return {name: dict(zip((STEP, FIBRES), np.median(least[name], axis=0), strict=True)) for name in chains}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--muscles", nargs="+", default=["adductor_brevis"])
    parser.add_argument("--frames", type=int, default=46)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", nargs="+", choices=SETTINGS, help="settings to measure")
    parser.add_argument("--stages", action="store_true", help="print what each filter adds to its kernels")
    arguments = parser.parse_args()
    for muscle_name in arguments.muscles:
        muscle = Muscle(muscle_name)
        times = muscle.scene.motion.times[: arguments.frames]
        chains = {name: muscle.chain(**SETTINGS[name]) for name in arguments.only or SETTINGS}
        report(muscle_name, measure(chains, times, arguments.rounds))
        for name in chains if arguments.stages else ():
            print(f"\n{muscle_name}, {name}")
            StageTimes(chains[name].metrics).report(times, arguments.rounds)


def report(muscle: str, measured: dict[str, dict[str, float]]) -> None:
    """Print what was measured of a muscle."""
    print(f"{muscle}, both bones; ms")
    print(f"  {'':28s} {'step':>7s} {'fibres':>7s} {'whole':>7s}")
    for name, ms in measured.items():
        print(f"  {name:28s} {ms[STEP]:7.2f} {ms[FIBRES]:7.2f} {ms[STEP] + ms[FIBRES]:7.2f}")


if __name__ == "__main__":
    main()
