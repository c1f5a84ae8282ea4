"""A leg of 30 muscles over 100 frames in one run: its time, and memory as it grows.

    python benchmarks/bench_leg.py
    python benchmarks/bench_leg.py --workers 1     # processor time by stage as well
    python benchmarks/bench_leg.py --deformer none --frames 25

The muscles are those of the phantom leg, three of each, with 100 fibres. The first run compiles what is not
compiled yet: run it twice. Processor time is of all threads and processes.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from run_stages import print_table
from sampling import Sampling

from vtkmuscle import Scene
from vtkmuscle.pipelines import DEFORMERS

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples" / "joints"))
from leg import leg

COPIES = 3
#: Amplitudes of flexion of the hip and of the knee, and of dorsiflexion, over a stride [degrees].
STRIDE = (40.0, 60.0, 12.0)


def scene_of(frames: int, deformer: str) -> Scene:
    """Return the leg over a stride."""
    cycle = 0.5 - 0.5 * np.cos(np.linspace(0.0, 2.0 * np.pi, frames))
    one = Scene.from_phantom(leg(coordinates=np.outer(cycle, STRIDE)))
    muscles = {
        f"{name}_{copy}": muscle for copy in range(1, COPIES + 1) for name, muscle in one.muscles.items()
    }
    return replace(one, muscles=muscles, deformer=deformer)


def memory(whose: int = resource.RUSAGE_SELF) -> float:
    """Return the most memory that this process, or the largest of others, has held so far [MB]."""
    peak = resource.getrusage(whose).ru_maxrss
    return peak / (1024.0**2 if sys.platform == "darwin" else 1024.0)


def main() -> None:
    """Run it and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--deformer", choices=tuple(DEFORMERS), default="paths")
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    scene = scene_of(given.frames, given.deformer)
    at: dict[int, float] = {}

    def note(muscle: str, _: str, fraction: float) -> None:
        if fraction > 0.0:  # a frame is done
            seen.append(muscle)
        done = len(seen)
        for part in range(1, 5):
            if done == part * len(scene.muscles) * given.frames // 4:
                at[25 * part] = memory()

    seen: list[str] = []
    before, began, used = memory(), time.perf_counter(), time.process_time()
    with tempfile.TemporaryDirectory() as folder, Sampling() as sampling:
        result = scene.run(Path(folder) / "out", figures=False, workers=given.workers, progress=note)
    wall = time.perf_counter() - began
    others = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = time.process_time() - used + others.ru_utime + others.ru_stime
    print(
        f"{len(scene.muscles)} muscles, {given.frames} frames, deformer {given.deformer}, "
        f"{given.workers} workers: "
        f"{wall:.0f} s by the clock, {processor:.0f} s of processor time"
    )
    if given.workers == 1:
        print_table(sampling.seconds)
    grown = ", ".join(f"{part} %: {size:.0f}" for part, size in at.items())
    print(f"memory [MB]: {before:.0f} before; at most until {grown}; at the end {memory():.0f}")
    print(f"of the largest other process [MB]: {memory(resource.RUSAGE_CHILDREN):.0f}")
    print(
        "verdicts:", {word: list(result.verdicts.values()).count(word) for word in ("ok", "look", "failed")}
    )


if __name__ == "__main__":
    main()
