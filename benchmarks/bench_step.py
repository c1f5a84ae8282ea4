"""Measure a whole step of a muscle of the real hip: bare iterations, solve, collision, report, fibres.

Run as ``python benchmarks/bench_step.py [--muscle NAME] [--iterations N] [--frames N] [--prune P]``. A step
is a frame of hip flexion (2 degrees), both bones are there, fibres are given and transported. The bare
iterations are measured beside each step, so that both see the same machine; medians over the frames are
printed, and their ratio.
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
from muscle_problem import data_folder

from vtkmuscle import Scene
from vtkmuscle.core import contact, solver
from vtkmuscle.core.batched_iteration import BatchedIteration
from vtkmuscle.core.batches import pack
from vtkmuscle.core.topology import mesh_topology
from vtkmuscle.filters.arrays import checked_surface, point_array, points_of
from vtkmuscle.filters.fibre_transport import FibreTransport
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.pipelines import decompose, deform


class Stopwatch:
    """Adds up the time spent in functions, frame by frame [ms]."""

    def __init__(self) -> None:
        self.frames: dict[str, list[float]] = {}
        self._now: dict[str, float] = {}

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
        start = time.perf_counter()
        try:
            yield
        finally:
            self._now[stage] = self._now.get(stage, 0.0) + 1e3 * (time.perf_counter() - start)

    def next_frame(self) -> None:
        """Keep the sums of this frame and begin with the next."""
        for stage, ms in self._now.items():
            self.frames.setdefault(stage, []).append(ms)
        self._now.clear()


def bare_iteration(detector: FixedPointDetector) -> tuple[BatchedIteration, np.ndarray]:
    """Return the iteration of a muscle, without bones, and the records of its points."""
    rest = detector.update().output
    points, triangles = points_of(rest), checked_surface(rest, "benchmark")[1]
    points = points - points.mean(axis=0)
    mass = (point_array(rest, "FixedTo", "benchmark") < 0).astype(float)
    bare = BatchedIteration(pack(mesh_topology(len(points), triangles), points, mass, shape_stiffness=0.9))
    return bare, bare.muscle.records(points)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--muscle", default="adductor_brevis")
    parser.add_argument("--iterations", type=int, default=10)
    parser.add_argument("--frames", type=int, default=46)
    parser.add_argument("--solver", default="anderson", choices=("anderson", "gauss-seidel"))
    parser.add_argument("--collision", default="sdf", choices=("sdf", "voxel", "none"))
    parser.add_argument("--prune", type=float, default=0.0, help="of FibreTransport: 0 keeps all weights")
    parser.add_argument("--profile", action="store_true", help="print what the steps are spent in")
    arguments = parser.parse_args()

    scene = Scene.load(data_folder() / "scene.toml")
    muscle = scene.muscles[arguments.muscle]
    attachments = scene.attachments_data(arguments.muscle)
    detector = FixedPointDetector(**scene.fixing_of(arguments.muscle))
    for port, value in enumerate((muscle.surface, scene.bones_data(), attachments)):
        detector.connect(port, value)
    fibres = decompose(detector, attachments, **(muscle.fibres or {}))
    settings = {name: getattr(arguments, name) for name in ("iterations", "solver", "collision")}
    deformer = deform(detector, scene.bones_data(), scene.motion, fibres=fibres, fixed=None, **settings)
    transport = FibreTransport(prune=arguments.prune)
    for port, value in enumerate((fibres, detector, deformer)):
        transport.connect(port, value)
    times = scene.motion.times[: arguments.frames]
    transport.update(time=times[0])

    bare, records = bare_iteration(detector)
    watch = Stopwatch()
    watch.wrap(solver.MuscleSolver, "step", "  of it: solve")
    watch.wrap(contact.Contact, "keep_out", "    of it: collision")
    watch.wrap(solver.MuscleSolver, "report", "  of it: report")
    watch.wrap(PBDDeformer, "_prepare", "  of it: reading inputs")
    profiler = cProfile.Profile()
    for now in times[1:]:
        with watch.measured("bare iterations"):
            bare.run(records, arguments.iterations)
        if arguments.profile:
            profiler.enable()
        with watch.measured("step of PBDDeformer"):
            deformer.update(time=now)
        profiler.disable()
        with watch.measured("transport of the fibres"):
            transport.update(time=now)
        watch.next_frame()
    print(f"{arguments.muscle}, {bare.muscle.n_points} points, {arguments.iterations} iterations, both bones")
    medians = {stage: float(np.median(ms)) for stage, ms in watch.frames.items()}
    order = ["bare iterations", "step of PBDDeformer", "  of it: reading inputs", "  of it: solve"]
    order += ["    of it: collision", "  of it: report", "transport of the fibres"]
    for stage in order:
        if stage in medians:
            print(f"  {stage:28s} {medians[stage]:8.3f} ms, least {min(watch.frames[stage]):8.3f}")
    step, bones = medians["step of PBDDeformer"], medians["bare iterations"]
    whole = step + medians["transport of the fibres"]
    print(f"  step / bare iterations {step / bones:.2f}; with the fibres {whole / bones:.2f} (bound 2.5)")
    if arguments.profile:
        pstats.Stats(profiler).sort_stats("tottime").print_stats(25)


if __name__ == "__main__":
    main()
