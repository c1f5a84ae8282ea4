"""Guard against regressions: ``python benchmarks/guard.py [--update] [--json FILE] [--only NAME ...]``.

Prints JSON, and compares it with ``guard.json`` beside this file, the last committed result.

``ratios`` are times over that of a calibration kernel that this project will not change (naive Gauss-Seidel
on edge lengths, compiled), both measured in turns in this process: a slow machine slows both. One that grew
by more than ``--margin`` (1.5) is a regression, and the exit status 1. ``scaling`` are powers: how time grows
with triangles, fibres, bones and frames (1 is in proportion), and what two threads gain. ``counts`` do not
depend on the machine at all: projections, collision passes, executions of filters, and the most memory of a
step; the tests hold them to the committed ones.
"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import tracemalloc
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from bench_kernels import torus
from naive_kernels import naive_dihedral, naive_distance
from timing import interleaved

from vtkmuscle import Scene, phantoms
from vtkmuscle.core import constraints, contact, projection
from vtkmuscle.core.batched_iteration import BatchedIteration, available_threads
from vtkmuscle.core.batches import pack
from vtkmuscle.core.mesh import edge_lengths
from vtkmuscle.core.rigid import RigidMotion
from vtkmuscle.core.sparse_weights import sparse_mean_value_coordinates, sparse_transport
from vtkmuscle.core.topology import mesh_topology
from vtkmuscle.filters import FibreMetrics, FixedPointDetector
from vtkmuscle.filters.arrays import blocks_of, checked_surface, multiblock_from, points_of, with_points
from vtkmuscle.filters.base import Filter
from vtkmuscle.pipelines import decompose, deform

COMMITTED = Path(__file__).with_name("guard.json")
MARGIN = 1.5
#: A power of growth may be more than the committed one by this.
POWER_MARGIN = 0.25
SHAPE_STIFFNESS = 0.9
TRIANGLES = 10_000
#: How often each is measured; whole scenes a few times only.
ROUNDS, FEW = 20, 3


def calibration() -> Callable[[], object]:
    """Return the kernel that all times are divided by: it takes some 0.1 ms, and is run ten times."""
    points, triangles = torus(TRIANGLES)
    edges = mesh_topology(len(points), triangles).edges
    rest, ones, mass = edge_lengths(points, edges), np.ones(len(edges)), np.ones(len(points))
    moved = 1.01 * points

    def run() -> None:
        for _ in range(10):
            naive_distance(moved, mass, edges, rest, ones)

    return run


def iteration_of(n_triangles: int, *, dtype: str = "float64", threads: int = 1) -> Callable[[], object]:
    """Return one whole batched iteration on a mesh of about so many triangles."""
    points, triangles = torus(n_triangles)
    mass = np.ones(len(points))
    mass[: len(points) // 20] = 0.0
    topology = mesh_topology(len(points), triangles)
    muscle = pack(topology, points, mass, shape_stiffness=SHAPE_STIFFNESS, dtype=dtype)
    iteration = BatchedIteration(muscle, threads=threads)
    records = muscle.records(points + 0.01 * np.sin(np.arange(points.size)).reshape(-1, 3))
    return lambda: iteration.run(records, 1)


def naive_iteration_of(n_triangles: int) -> Callable[[], object]:
    """Return the same by the naive kernels, with trigonometry."""
    points, triangles = torus(n_triangles)
    mass = np.ones(len(points))
    mass[: len(points) // 20] = 0.0
    topology = mesh_topology(len(points), triangles)
    edges, quads = topology.edges, np.ascontiguousarray(topology.quads)
    lengths, ones = edge_lengths(points, edges), np.ones(len(edges))
    angles, _ = constraints.dihedral_angle(*(points[quads[:, i]] for i in range(4)))
    gradient = np.empty_like(points)
    volume = constraints.volume_and_gradient(points, triangles, gradient)
    p = points + 0.01 * np.sin(np.arange(points.size)).reshape(-1, 3)

    def run() -> None:
        naive_distance(p, mass, edges, lengths, ones)
        naive_dihedral(p, mass, quads, angles, SHAPE_STIFFNESS)
        constraints.project_volume(p, mass, triangles, volume, 0.0, 1.0, gradient)

    return run


class Hip:
    """The phantom hip, and the pieces of it that are measured."""

    def __init__(self) -> None:
        self.phantom = phantoms.hip()
        self.muscle = self.phantom.muscles["iliacus"]
        self.areas = self.phantom.attachments["iliacus"]
        self.marked = FixedPointDetector()(self.muscle, self.phantom.bones, self.areas)

    def fibres(self, n_fibres: int = 100) -> Any:
        """Return new fibres."""
        return decompose(self.muscle, self.areas, n_fibres=n_fibres).update().output

    def frames(self, last: int, *, n_far: int = 0) -> Any:
        """Deform the iliacus over so many frames of flexion, with more bones far away."""
        phantom = self.phantom
        blocks = dict(blocks_of(phantom.bones))
        bone = blocks["femur"]
        for number in range(n_far):
            blocks[f"far {number}"] = with_points(bone, points_of(bone) + 600.0 * (number + 1))
        motion = RigidMotion(phantom.motion.times, dict(phantom.motion.transforms))
        chain = deform(self.marked, multiblock_from(blocks), motion, fixed=None)
        return chain.update(time=float(motion.times[last])).output

    def scene(self, last: int) -> Any:
        """Run the whole scene, its muscles, fibres and measures, over so many frames."""
        scene = Scene.from_phantom(self.phantom, n_fibres=20)
        return scene.run(frames=slice(0, last + 1), figures=False, workers=1)


def entries(hip: Hip) -> dict[str, tuple[Callable[[], object], int]]:
    """Return what is timed, and in how many rounds."""
    points, triangles = checked_surface(hip.muscle, "iliacus")
    round_mesh = torus(TRIANGLES)
    fibres = hip.fibres()
    queries = points_of(fibres)
    weights = sparse_mean_value_coordinates(points, triangles, queries, prune=0.0)
    return {
        "kernel: batched iteration": (iteration_of(TRIANGLES), ROUNDS),
        "kernel: batched iteration, float32": (iteration_of(TRIANGLES, dtype="float32"), ROUNDS),
        "kernel: mean value weights of 1600 points": (
            lambda: sparse_mean_value_coordinates(points, triangles, queries, prune=0.0, threads=1),
            FEW,
        ),
        "kernel: transport of 1600 points": (lambda: sparse_transport(weights, points, threads=1), ROUNDS),
        "core: topology": (lambda: mesh_topology(len(round_mesh[0]), round_mesh[1]), ROUNDS),
        "filter: fixed points": (
            lambda: FixedPointDetector()(hip.muscle, hip.phantom.bones, hip.areas),
            FEW,
        ),
        "filters: 100 fibres": (hip.fibres, FEW),
        "filter: measures of fibres": (lambda: FibreMetrics()(fibres, hip.muscle), FEW),
        "filter: muscle over 10 frames": (lambda: hip.frames(10), FEW),
        "scene: phantom hip, 3 muscles, 3 frames": (lambda: hip.scene(2), FEW),
    }


def ratios(hip: Hip, only: list[str] | None = None) -> dict[str, float]:
    """Return how long each takes, in units of the calibration kernel."""
    found = {}
    for name, (run, rounds) in entries(hip).items():
        if only is None or any(part in name for part in only):
            times = interleaved({"calibration": calibration(), "it": run}, rounds=rounds)
            found[name] = round(times["it"] / times["calibration"], 3)
    return found


def power(runs: Mapping[int, Callable[[], object]], rounds: int) -> float:
    """Return the power of the size with which time grows, by the ends."""
    times = interleaved({str(size): run for size, run in runs.items()}, rounds=rounds)
    low, high = min(runs), max(runs)
    return round(float(np.log(times[str(high)] / times[str(low)]) / np.log(high / low)), 3)


def scaling(hip: Hip, largest: int) -> dict[str, float]:
    """Return how time grows: powers, and what two threads gain."""
    sizes = [n for n in (1_000, 10_000, 100_000, 1_000_000) if n <= largest]
    found = {
        f"triangles, iteration, {sizes[0]} to {sizes[-1]}": power({n: iteration_of(n) for n in sizes}, 10),
        "fibres, 10 to 1000": power({n: lambda n=n: hip.fibres(n) for n in (10, 1000)}, FEW),
        "bones far away, 2 to 20": power({n: lambda n=n: hip.frames(5, n_far=n - 2) for n in (2, 20)}, FEW),
        "frames, 5 to 40": power({n: lambda n=n: hip.frames(n) for n in (5, 40)}, FEW),
    }
    if available_threads() > 1:
        times = interleaved({str(n): iteration_of(100_000, threads=n) for n in (1, 2)}, rounds=10)
        found["gain of two threads, 100 000 triangles"] = round(times["1"] / times["2"], 2)
    return found


@contextmanager
def counted(counts: Counter[str]) -> Iterator[None]:
    """Count projections, collision passes, and executions of filters."""
    watched = (
        ("projections", projection.ColourOrder, "iterate"),
        ("collision passes", contact.Contact, "keep_out"),
        ("executions", Filter, "RequestData"),
    )
    originals = [getattr(owner, name) for _, owner, name in watched]

    def counting(original: Any, what: str) -> Any:
        def run(self: Any, *arguments: Any, **keywords: Any) -> Any:
            counts[what if what != "executions" else f"executions of {type(self).__name__}"] += 1
            return original(self, *arguments, **keywords)

        return run

    for (what, owner, name), original in zip(watched, originals, strict=True):
        setattr(owner, name, counting(original, what))
    try:
        yield
    finally:
        for (_, owner, name), original in zip(watched, originals, strict=True):
            setattr(owner, name, original)


def counts() -> dict[str, int]:
    """Return what does not depend on the machine: counts over a run of a small scene, and memory."""
    phantom = phantoms.spindle_over_hinge()
    scene = Scene.from_phantom(phantom, n_fibres=10)
    scene.run(frames=slice(0, 2), figures=False, workers=1)  # compiles, and builds what is kept
    found: Counter[str] = Counter()
    with counted(found):
        scene.run(frames=slice(0, 6), figures=False, workers=1)
    (name, muscle), *_ = phantom.muscles.items()
    marked = FixedPointDetector()(muscle, phantom.bones, phantom.attachments[name])
    chain = deform(marked, phantom.bones, phantom.motion, fixed=None, threads=1)
    chain.update(time=float(phantom.motion.times[2]))
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    chain.update(time=float(phantom.motion.times[3]))
    peak = tracemalloc.get_traced_memory()[1] - before
    tracemalloc.stop()
    return {**dict(sorted(found.items())), "bytes per point of a step": peak // muscle.GetNumberOfPoints()}


def regressions(now: Mapping[str, Any], before: Mapping[str, Any], margin: float = MARGIN) -> list[str]:
    """Return what got worse, in words; what only one of the two has is left out."""
    worse = []
    for name, ratio in now.get("ratios", {}).items():
        old = before.get("ratios", {}).get(name)
        if old is not None and ratio > margin * old:
            worse.append(f"{name}: {ratio:g} calibrations, was {old:g} ({ratio / old:.2f} times)")
    for name, power_now in now.get("scaling", {}).items():
        old = before.get("scaling", {}).get(name)
        if old is None:
            continue
        if name.startswith("gain"):
            if power_now < old / margin:
                worse.append(f"{name}: {power_now:g}, was {old:g}")
        elif power_now > old + POWER_MARGIN:
            worse.append(f"{name}: grows with the power {power_now:g}, was {old:g}")
    for name, count in now.get("counts", {}).items():
        old = before.get("counts", {}).get(name)
        slack = 1.25 if name.startswith("bytes") else 1.0
        if old is not None and count > slack * old:
            worse.append(f"{name}: {count}, was {old}")
    return worse


def main() -> None:
    """Measure, print, compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--update", action="store_true", help=f"write {COMMITTED.name}")
    parser.add_argument("--json", type=Path, help="write the result there, too")
    parser.add_argument("--only", nargs="+", help="ratios whose name has one of these parts; nothing else")
    parser.add_argument("--largest", type=int, default=100_000, help="most triangles of the scaling")
    parser.add_argument("--margin", type=float, default=MARGIN)
    asked = parser.parse_args()
    hip = Hip()
    result: dict[str, Any] = {"machine": f"{platform.machine()}, Python {platform.python_version()}"}
    result["calibration_ms"] = round(interleaved({"": calibration()}, rounds=ROUNDS)[""], 3)
    result["ratios"] = ratios(hip, asked.only)
    if asked.only is None:
        result["scaling"] = scaling(hip, asked.largest)
        result["counts"] = counts()
    text = json.dumps(result, indent=2) + "\n"
    print(text)
    for path in (asked.json, COMMITTED if asked.update else None):
        if path is not None:
            path.write_text(text, encoding="utf-8")
    if asked.update:
        return
    worse = regressions(result, json.loads(COMMITTED.read_text(encoding="utf-8")), asked.margin)
    print("\n".join(worse) or "no regression", file=sys.stderr)
    raise SystemExit(bool(worse))


if __name__ == "__main__":
    main()
