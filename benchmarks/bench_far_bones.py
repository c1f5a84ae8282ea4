"""Measure what bones cost that a muscle never meets: the same muscle with and without ten more, far away.

Run as ``python benchmarks/bench_far_bones.py [--move]``; with ``--move`` the far bones move, too, which
BoneMotion has to carry out. It takes the phantom hip, and the far bones are copies of its own.

Both chains advance frame by frame, in turns, so that whatever else the machine does falls on both. A step is
PathDeformer alone, a frame all of the chain.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.data.arrays import blocks_of, multiblock_from, points_of, with_points
from vtkmuscle.phantoms import hip
from vtkmuscle.pipelines import deform

#: Where the far bones are, away from the muscle and from each other [mm].
FAR = 600.0


def chain(phantom, name, n_far, *, move):
    """Return the deformer of a muscle in a scene with so many more bones."""
    blocks = dict(blocks_of(phantom.bones))
    transforms = dict(phantom.motion.transforms)
    moving = next(iter(transforms.values()))
    for number in range(n_far):
        bone = list(blocks.values())[number % 2]
        blocks[f"far {number}"] = with_points(
            bone, points_of(bone) + np.array([FAR * (number + 1), FAR, 0.0])
        )
        if move:
            transforms[f"far {number}"] = moving
    motion = RigidMotion(phantom.motion.times, transforms)
    muscle, attachments = phantom.muscles[name], phantom.attachments[name]
    return deform(muscle, multiblock_from(blocks), motion, attachments), motion


def main():
    """Measure both chains, frame by frame in turns."""
    options = argparse.ArgumentParser()
    options.add_argument("--move", action="store_true")
    options.add_argument("--far", type=int, default=10)
    options.add_argument("--repeats", type=int, default=5)
    chosen = options.parse_args()
    phantom = hip()
    for name in phantom.muscles:
        steps, frames = {0: [], chosen.far: []}, {0: [], chosen.far: []}
        for _ in range(chosen.repeats):
            chains = {n: chain(phantom, name, n, move=chosen.move) for n in steps}
            for at in next(iter(chains.values()))[1].times:
                for n, (deformer, _) in chains.items():
                    clock = [time.perf_counter()]
                    for stage in (deformer.paths, deformer):
                        stage.update(time=float(at))
                        clock.append(time.perf_counter())
                    frames[n].append(1e3 * (clock[2] - clock[0]))
                    steps[n].append(1e3 * (clock[2] - clock[1]))
        # The least over the repeats of each frame, but the first, in which everything is built.
        least = {
            n: [np.reshape(values[n], (chosen.repeats, -1)).min(axis=0)[1:] for values in (steps, frames)]
            for n in steps
        }
        without, with_far = least[0], least[chosen.far]
        parts = [100.0 * (b.sum() / a.sum() - 1.0) for a, b in zip(without, with_far, strict=True)]
        print(
            f"{name}: step {without[0].mean():.3f} ms, with {chosen.far} far bones {parts[0]:+.1f} %; "
            f"frame {without[1].mean():.3f} ms, {parts[1]:+.1f} %"
        )


if __name__ == "__main__":
    main()
