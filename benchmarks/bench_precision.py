"""Measure what single precision changes: error against double, and time per step of the solver.

Run as ``python benchmarks/bench_precision.py``. A muscle of the real hip is turned in steps of 2 degrees,
from the blended start, without bones.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from muscle_problem import turned_muscle

from vtkmuscle.core.motion.blending import screw_between
from vtkmuscle.core.pbd.solver import MuscleSolver, SolverParameters

#: Turn of a step [degrees].
STEP = 2.0


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--muscle", default="adductor_brevis")
    parser.add_argument("--angle", type=float, default=40.0, help="turn in the end [degrees]")
    arguments = parser.parse_args()
    problem = turned_muscle(arguments.muscle, arguments.angle)
    count = round(arguments.angle / STEP)
    points = len(problem.points)
    print(f"{arguments.muscle}, {points} points, turned by {arguments.angle:g} degrees in {count} steps")
    print("iterations  ms/step float64  float32  difference after the last step: rms     max [mm]")
    for iterations in (10, 50, 200):
        ends, best = {}, {}
        for dtype in ("float64", "float32"):
            settings = SolverParameters(iterations=iterations, solver="gauss-seidel", dtype=dtype)
            solver = MuscleSolver(problem.points, problem.triangles, problem.fixed_to, settings)
            state = solver.rest_state(2)
            best[dtype] = np.inf
            for step in range(count):
                part = (step + 1) / count
                now = np.array([screw_between(np.eye(4), t, part) for t in problem.transforms])
                start = time.perf_counter()
                state = solver.step(state, now)
                best[dtype] = min(best[dtype], 1e3 * (time.perf_counter() - start))
            ends[dtype] = state.positions
        away = np.linalg.norm(ends["float32"] - ends["float64"], axis=1)
        rms, most = np.sqrt((away**2).mean()), away.max()
        print(f"{iterations:10d} {best['float64']:16.2f} {best['float32']:8.2f} {rms:39.1e} {most:9.1e}")


if __name__ == "__main__":
    main()
