"""Measure how long solvers take to come near the converged shape, and how well the distance is estimated.

Run as ``python benchmarks/bench_convergence.py [--plain SECONDS]``; ``--plain`` is how long plain
Gauss-Seidel may run per problem. The problem: a muscle of the real hip, the outermost 5 % of its points
along its long axis fixed at either end, one end turned about a hinge at the other. (Turned by +20 degrees
the adductor brevis is crushed so that its Gauss-Seidel iteration has no fixed point: folds flip for ever.)
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np
from muscle_problem import Problem, turned_muscle
from naive_kernels import naive_dihedral, naive_distance

from vtkmuscle.core import constraints
from vtkmuscle.core.anderson import anderson
from vtkmuscle.core.anisotropy import edge_stiffness, harmonic_directions
from vtkmuscle.core.batched_iteration import BatchedIteration, FreePoints
from vtkmuscle.core.batches import pack
from vtkmuscle.core.coarse import CoarseMuscle
from vtkmuscle.core.mesh import edge_lengths
from vtkmuscle.core.topology import mesh_topology

SHAPE_STIFFNESS = 0.9
MUSCLES = ("adductor_brevis", "iliacus", "gluteus_medius", "gluteus_maximus")

#: Distances that times are given for [mm].
TARGETS = (0.1, 0.01)


def anisotropic(points, topology, fixed_to):
    """Return the stiffness of edges by their direction to the harmonic field between the ends."""
    return edge_stiffness(points, topology.edges, harmonic_directions(points, topology, fixed_to))


@dataclass
class Solvers:
    """All ways to solve one problem."""

    problem: Problem
    aniso: bool = False

    def __post_init__(self) -> None:
        problem = self.problem
        self.topology = mesh_topology(len(problem.points), problem.triangles)
        stiffness = anisotropic(problem.points, self.topology, problem.fixed_to) if self.aniso else 1.0
        self.iteration = BatchedIteration(
            pack(
                self.topology,
                problem.points,
                problem.mass,
                edge_stiffness=stiffness,
                shape_stiffness=SHAPE_STIFFNESS,
            )
        )
        self.coarse = CoarseMuscle(
            problem.points,
            problem.triangles,
            problem.fixed_to,
            stiffness_of=anisotropic if self.aniso else None,
            shape_stiffness=SHAPE_STIFFNESS,
        )
        self.coarse_begin = self.coarse.place(
            self.coarse.rest, np.broadcast_to(np.eye(4), (2, 4, 4)), problem.transforms
        )
        self.amplification = self.coarse.amplification(self.coarse_begin)
        self.points = len(problem.free.nonzero()[0])

    def coarse_start(self) -> np.ndarray:
        """Return the full muscle after the coarse one has been solved."""
        solved, _ = self.coarse.solve(self.coarse_begin)
        return self.problem.with_fixed_in_place(self.coarse.prolong(solved, self.problem.points))

    def accelerated(self, start, iterations, **options):
        """Solve by Anderson acceleration from a start; return all points and the result."""
        step = FreePoints(self.iteration, start)
        result = anderson(
            step, step.first, max_iterations=iterations, amplification=self.amplification, **options
        )
        return step.positions(result.x), result

    def distance(self, a, b) -> float:
        """Return the root mean square distance over the free points [mm]."""
        return float(np.linalg.norm((a - b)[self.problem.free]) / np.sqrt(self.points))


def naive_iteration_time(problem: Problem) -> float:
    """Return the time of one iteration of the naive scalar kernels [s]."""
    points, triangles, mass = problem.points, problem.triangles, problem.mass
    topology = mesh_topology(len(points), triangles)
    edges = topology.edges[(mass[topology.edges] > 0).any(axis=1)]
    lengths, ones = edge_lengths(points, edges), np.ones(len(edges))
    quads = np.ascontiguousarray(topology.quads[(mass[topology.quads] > 0).any(axis=1)])
    angles, _ = constraints.dihedral_angle(*(points[quads[:, i]] for i in range(4)))
    gradient, p = np.empty_like(points), problem.blended_start()
    best = np.inf
    for _ in range(20):
        start = time.perf_counter()
        naive_distance(p, mass, edges, lengths, ones)
        naive_dihedral(p, mass, quads, angles, SHAPE_STIFFNESS)
        constraints.project_volume(p, mass, triangles, 1e5, 0.0, 0.0, gradient)
        best = min(best, time.perf_counter() - start)
    return best


def first_below(distances, target):
    """Return the first iteration at which the distance is and stays below a target, or None."""
    above = np.flatnonzero(np.array(distances) >= target)
    first = 0 if not len(above) else int(above[-1]) + 1
    return first if first < len(distances) else None


def compare(name: str, angle: float, plain_seconds: float) -> None:
    """Print the table of FINDINGS for one problem."""
    problem = turned_muscle(name, angle)
    solvers = Solvers(problem)
    cold, blended = problem.cold_start(), problem.blended_start()
    solvers.coarse_start()
    begin = time.perf_counter()
    coarse = solvers.coarse_start()
    coarse_seconds = time.perf_counter() - begin
    reference, limit = solvers.accelerated(coarse, 6000)
    print(
        f"\n{name}, {len(problem.points)} points, {angle:g} degrees; reference: residual "
        f"{limit.residual:.1e} mm, distance estimated {limit.distance:.1e} mm"
    )
    print(
        f"  from rest {solvers.distance(cold, reference):.3f} mm, blended "
        f"{solvers.distance(blended, reference):.3f} mm, coarse {solvers.distance(coarse, reference):.3f} mm "
        f"(solved and prolonged in {1e3 * coarse_seconds:.1f} ms)"
    )
    records = solvers.iteration.muscle.records(cold)
    chunk, distances, seconds = 100, [], 0.0
    while seconds < plain_seconds and (not distances or distances[-1] > TARGETS[-1]):
        begin = time.perf_counter()
        solvers.iteration.run(records, chunk)
        seconds += time.perf_counter() - begin
        distances.append(solvers.distance(solvers.iteration.muscle.points(records), reference))
    per_iteration = seconds / (chunk * len(distances))
    naive = naive_iteration_time(problem)
    rows = []
    for label, cost in (("naive Gauss-Seidel (iterations of the fast one)", naive), ("fast", per_iteration)):
        found = [first_below(distances, target) for target in TARGETS]
        rows.append(
            (label, [None if k is None else chunk * (k + 1) for k in found], cost, 0.0, distances[-1])
        )
    for label, start, extra in (
        ("Anderson, from rest", cold, 0.0),
        ("Anderson, blended start", blended, 0.0),
        ("coarse, then Anderson", coarse, coarse_seconds),
    ):
        seen: list[float] = []
        goal = reference[problem.free].reshape(-1)

        def observe(_count, x, _residual, seen=seen, goal=goal):
            seen.append(float(np.linalg.norm(x - goal) / np.sqrt(len(x) / 3.0)))

        solvers.accelerated(start, 3000, observe=observe)
        begin = time.perf_counter()
        solvers.accelerated(start, 200)
        cost = (time.perf_counter() - begin) / 200
        rows.append((label, [first_below(seen, target) for target in TARGETS], cost, extra, seen[-1]))
    print(f"  {'':48s} ms/iteration" + "".join(f"{f'to {t} mm':>26s}" for t in TARGETS))
    for label, found, cost, extra, last in rows:
        cells = ""
        for iterations in found:
            if iterations is None:
                cells += f"{f'not yet: {last:.3f} mm':>26s}"
            else:
                cells += f"{f'{iterations} it., {extra + iterations * cost:.3f} s':>26s}"
        print(f"  {label:48s} {1e3 * cost:12.3f}{cells}")


def estimates() -> None:
    """Print how the estimated distance compares with the true one along the way."""
    print("\nEstimated over true distance, where the latter is 0.01 to 1 mm, every 10 iterations from 20 on")
    print(f"  {'':44s} checkpoints   5th    50th   95th percentile   within a factor of 2")
    everything = []
    for name in MUSCLES:
        for aniso in (False, True):
            for angle in (1.0, -2.0, 5.0):
                solvers = Solvers(turned_muscle(name, angle), aniso=aniso)
                start = solvers.problem.blended_start()
                _, limit = solvers.accelerated(solvers.coarse_start(), 4000)
                if limit.residual > 1e-8:
                    continue
                goal = limit.x
                true: dict[int, float] = {}

                def observe(count, x, _residual, true=true, goal=goal):
                    true[count + 1] = float(np.linalg.norm(x - goal) / np.sqrt(len(x) / 3.0))

                ratios = []
                _, result = solvers.accelerated(start, 600, observe=observe)
                for count, distance in result.estimates:
                    k = int(count)
                    if k >= 20 and k % 10 == 0 and 0.01 <= true[k] <= 1.0:
                        ratios.append(distance / true[k])
                if ratios:
                    everything += ratios
                    report(f"{name}, {angle:g} degrees, {'anisotropic' if aniso else 'isotropic'}", ratios)
    report("all", everything)


def report(label: str, ratios: list[float]) -> None:
    """Print one line of the table of estimates."""
    low, middle, high = np.percentile(ratios, [5, 50, 95])
    within = np.mean([0.5 <= r <= 2.0 for r in ratios])
    print(f"  {label:44s} {len(ratios):8d} {low:9.2f} {middle:7.2f} {high:6.2f} {within:18.0%}")


def main() -> None:
    """Run all measurements."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plain", type=float, default=45.0, help="seconds for plain Gauss-Seidel")
    arguments = parser.parse_args()
    for angle in (1.0, -20.0):
        compare("adductor_brevis", angle, arguments.plain)
    estimates()


if __name__ == "__main__":
    main()
