"""Measure how near to the converged shape the ways to solve a step come, in which time, on a real hip.

Run as ``python benchmarks/bench_convergence.py SCENE [--muscles NAME ...] [--every 9]``. Each way takes each
muscle through the whole motion of the scene, with collision. At every so many frames its shape is compared
with the converged shape of that frame: where :data:`END` iterations more take it. Times are of
the process [ms], medians over the frames.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

from vtkmuscle import Scene
from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.run import muscle_pipeline

END = 1000
P21 = {"quality": "published"}
WAYS = {
    "P21": P21,
    "taut": {"solver": "gauss-seidel"},
    "taut, Anderson": {"solver": "anderson"},
    "stiffness, Anderson": {"anisotropy": "stiffness", "solver": "anderson"},
}
ITERATIONS = (3, 10, 25, 50)


def solver_of(inputs, first, **settings):
    """Return the solver that a deformer makes."""
    fixed, bones, motion, fibres = inputs
    deformer = MusclePipeline(fixed, bones, motion, fibres=fibres, solver=settings).deformer
    deformer.update(first)
    return deformer._made_solver()


def measure(inputs, transforms, first, every, settings):
    """Return time per frame [ms], distances and estimated distances to the converged shapes [mm]."""
    solver = solver_of(inputs, first, **settings)
    anisotropy = settings.get("anisotropy", "taut")
    settled = {"prediction": "blend", "solver": "anderson", "iterations": END, "tolerance": 1e-6}
    end = solver_of(inputs, first, **settled, anisotropy=anisotropy)
    free = solver.fixed_to < 0
    state = solver.rest_state(transforms.shape[1])
    took, distances, estimates = [], [], []
    for number, now in enumerate(transforms[1:], start=1):
        begin = time.process_time()
        state = solver.step(state, now)
        took.append(1e3 * (time.process_time() - begin))
        if number % every == 0:
            converged = end.step(replace(state, velocities=np.zeros_like(state.velocities)), now)
            away = (state.positions - converged.positions)[free]
            distances.append(float(np.sqrt(np.mean(np.sum(away**2, axis=1)))))
            estimates.append(np.nan if state.distance is None else state.distance)
    return float(np.median(took)), np.array(distances), np.array(estimates)


def main() -> None:
    """Print a table for each muscle."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene")
    parser.add_argument("--muscles", nargs="*")
    parser.add_argument("--every", type=int, default=9, help="compare at each so many frames")
    parser.add_argument("--iterations", type=int, nargs="*", default=ITERATIONS)
    parser.add_argument("--ways", nargs="*", default=list(WAYS), choices=list(WAYS))
    parser.add_argument("--stride", type=int, default=1, help="take so many frames of the scene in one step")
    arguments = parser.parse_args()
    scene = Scene.load(arguments.scene)
    times = scene.motion.times[:: arguments.stride]
    transforms = np.array([[scene.motion.at(t).get(name, np.eye(4)) for name in scene.bones] for t in times])
    ratios = []
    for name in arguments.muscles or scene.muscles:
        pipeline = muscle_pipeline(scene, name)
        inputs = pipeline.fixed, scene.bones_data(), scene.motion, pipeline.fibres
        print(
            f"{name}\n  {'':30s}{'iterations':>12s}{'ms / frame':>12s}{'median mm':>12s}{'largest mm':>12s}"
        )
        for label in arguments.ways:
            settings = WAYS[label]
            for iterations in arguments.iterations:
                took, distances, estimates = measure(
                    inputs,
                    transforms,
                    times[0],
                    arguments.every,
                    {"tolerance": 0.0, **settings, "iterations": iterations},
                )
                print(
                    f"  {label:30s}{iterations:12d}{took:12.1f}{np.median(distances):12.3f}"
                    f"{distances.max():12.3f}",
                    flush=True,
                )
                ratios += list((estimates / distances)[np.isfinite(estimates)])
    within = np.mean([0.5 <= ratio <= 2.0 for ratio in ratios])
    print(f"estimated distance within a factor of 2 of the true one: {within:.0%} of {len(ratios)} frames")


if __name__ == "__main__":
    main()
