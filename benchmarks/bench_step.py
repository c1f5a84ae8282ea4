"""Measure a whole step of a muscle of the real hip, stage by stage.

Run as ``python benchmarks/bench_step.py [--muscles NAME ...] [--only SETTINGS ...] [--stages]``.
A step is a frame of hip flexion (2 degrees): both bones move and are kept out of, fibres are given, and
carried along as scenes have it. The whole motion is run several times with each of the settings in turn, so
that all see the same machine. Times are of the processor, on one core; of each frame the least counts, so
that no field of a bone is filled in it, and the median over the frames is printed.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from real_hip import data_folder
from sampling import OTHER, Sampling, Stack, by_stage, collapsed

from vtkmuscle import Scene
from vtkmuscle.filters.fibre_transport import FibreTransport
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.run import muscle_pipeline

Stacks = dict[str, Counter[Stack]]

#: The settings that are measured.
SETTINGS: dict[str, dict[str, Any]] = {
    "preview": {"quality": "preview"},
    "balanced": {},
    "accurate": {"quality": "accurate"},
    "published": {"quality": "published", "iterations": 10},
}
STEP, FIBRES = "step", "fibres"
#: The calls that a stage is, without those of other stages within them.
STAGES = {
    "bone motion": ["filters/bone_motion:BoneMotion"],
    "reading inputs": ["filters/pbd_deformer:PBDDeformer._prepare"],
    "paths": ["core/paths/sheet:MusclePaths.follow"],
    "skinning": ["core/paths/skinning:Skinning.at", "core/paths/skinning:SkinnedMuscle.points"],
    "diffusion": ["core/deformation/diffusion:Diffusion.spread"],
    "collision": ["core/bones/contact:PoseContact"],
    "the rest of settling": ["core/deformation/settling:Settling.settle"],
    "report": ["core/mesh/rest_shape:RestShape.compare"],
    "result": ["filters/pbd_deformer:PBDDeformer._result", "filters/base/algorithm:Algorithm._publish"],
    FIBRES: ["filters/fibre_transport:FibreTransport", "filters/fibre_metrics:FibreMetrics"],
}


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


def measure(muscle: Muscle, times: np.ndarray, rounds: int) -> tuple[dict[str, dict[str, float]], Stacks]:
    """Return the least time of each part, the median over the frames [ms], and all of it by stack [s]."""
    chains = {name: muscle.chain(**settings) for name, settings in SETTINGS.items()}
    for _, transport in chains.values():
        transport.update(time=times[0])
        transport.update(time=times[1])
    stacks: Stacks = {name: Counter() for name in chains}
    least = {name: np.full((len(times) - 1, 2), np.inf) for name in chains}
    for name, (deformer, transport) in list(chains.items()) * rounds:
        transport.update(time=times[0])
        with Sampling() as sampling:
            for best, now in zip(least[name], times[1:], strict=True):
                clock = [time.thread_time()]
                for part in (deformer, transport):
                    part.update(time=now)
                    clock.append(time.thread_time())
                np.minimum(best, 1e3 * np.diff(clock), out=best)
        stacks[name] += sampling.seconds
    return {
        name: dict(zip((STEP, FIBRES), np.median(least[name], axis=0), strict=True)) for name in chains
    }, stacks


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--muscles", nargs="+", default=["adductor_brevis"])
    parser.add_argument("--frames", type=int, default=46)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--only", nargs="+", choices=SETTINGS, help="settings to measure")
    parser.add_argument("--stages", action="store_true", help="print what each step is made of, on average")
    parser.add_argument("--stacks", metavar="FILE", help="write the time of all steps by stack of calls")
    arguments = parser.parse_args()
    for name in set(SETTINGS) - set(arguments.only or SETTINGS):
        del SETTINGS[name]
    every: Counter[Stack] = Counter()
    for name in arguments.muscles:
        muscle = Muscle(name)
        times = muscle.scene.motion.times[: arguments.frames]
        least, stacks = measure(muscle, times, arguments.rounds)
        every.update(sum(stacks.values(), Counter()))
        report(name, least)
        if arguments.stages:
            report_stages(stacks, (len(times) - 1) * arguments.rounds)
    if arguments.stacks:
        Path(arguments.stacks).write_text(collapsed(every), encoding="utf-8")


def report(muscle: str, measured: dict[str, dict[str, float]]) -> None:
    """Print what was measured of a muscle."""
    print(f"{muscle}, both bones; ms")
    print(f"  {'':28s} {'step':>7s} {'fibres':>7s} {'whole':>7s}")
    for name, ms in measured.items():
        print(f"  {name:28s} {ms[STEP]:7.2f} {ms[FIBRES]:7.2f} {ms[STEP] + ms[FIBRES]:7.2f}")
    print("  (aim for the last column: adductor brevis 10 ms, gluteus maximus 20 ms)")


def report_stages(stacks: Stacks, steps: int) -> None:
    """Print the stages of steps with each of the settings."""
    found = {name: by_stage(seconds, STAGES) for name, seconds in stacks.items()}
    print(f"\n  {'stage, mean of all steps, ms':28s}" + "".join(f" {name[:20]:>20s}" for name in found))
    for stage in [*STAGES, OTHER]:
        row = "".join(f" {1e3 * seconds[stage] / steps:20.2f}" for seconds in found.values())
        print(f"  {stage:28s}{row}")


if __name__ == "__main__":
    main()
