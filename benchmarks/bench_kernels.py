"""Measure the vectorised Gauss-Seidel kernels: ratios to others, cost per size, memory.

Run as ``python benchmarks/bench_kernels.py [--pypbd PYTHON] [--largest TRIANGLES]``.
``--pypbd`` names a Python that has pypbd (it need not have vtkmuscle). Ratios hold better than times: all are
taken in one run, the measurements of the variants interleaved; on one core times are of the processor.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from muscle_problem import turned_muscle
from naive_kernels import naive_dihedral, naive_distance
from timing import interleaved

from vtkmuscle.core.mesh.surface import edge_lengths
from vtkmuscle.core.mesh.topology import MeshTopology, mesh_topology
from vtkmuscle.core.pbd import constraints
from vtkmuscle.core.pbd.batches import pack
from vtkmuscle.core.pbd.orders import BUFFER, ColourOrder, SequentialOrder, Stiffness, sweep_batches
from vtkmuscle.core.pbd.rest_shape import RestShape

SHAPE_STIFFNESS = 0.9

#: What is compared with pypbd, and how often.
EDGES, WHOLE = "batches: distance and dihedral", "batches, whole iteration"
TURNS = 25


def stiffness(topology: MeshTopology) -> Stiffness:
    """Return the stiffness that all kernels are measured with."""
    return Stiffness(np.ones(len(topology.edges)), SHAPE_STIFFNESS, 1.0)


def no_bones(p: np.ndarray) -> np.ndarray:
    """Keep points out of nothing."""
    return np.zeros(len(p), dtype=np.bool_)


def edges_of(
    topology: MeshTopology, points: np.ndarray, mass: np.ndarray, moved: np.ndarray
) -> Callable[[], object]:
    """Return the projection of all edges, batch by batch, without the volume."""
    packed = pack(topology, RestShape(points, topology), mass, 1.0, SHAPE_STIFFNESS)
    records, buffer = packed.records(), np.zeros(BUFFER)
    records.reshape(-1, 4)[:-1] = np.column_stack([moved, mass])
    return lambda: sweep_batches(records, packed.edge_at, packed.constants, buffer)


def compare(pypbd: str | None) -> None:
    """Print what an iteration takes on the adductor brevis, kernel by kernel."""
    problem = turned_muscle("adductor_brevis", 0.0)
    points, triangles, mass = problem.points, problem.triangles, problem.mass
    topology = mesh_topology(len(points), triangles)
    noise = np.random.default_rng(0).normal(scale=0.2, size=points.shape)
    moved = points + noise * mass[:, None]

    edges, quads = topology.edges, np.ascontiguousarray(topology.quads)
    lengths, ones = edge_lengths(points, edges), np.ones(len(edges))
    gradient = np.empty_like(points)

    start = time.perf_counter()
    shape = RestShape(points, topology)
    angles, volume = shape.angles, shape.volume
    batches = ColourOrder(topology, shape, mass, stiffness(topology))
    one_by_one = SequentialOrder(topology, shape, mass, stiffness(topology))
    sweep = edges_of(topology, points, mass, moved)
    p, q, r = moved.copy(), moved.copy(), moved.copy()
    sweep()
    batches.project(r, no_bones, bones_last=False)
    print(f"compile or load all kernels {time.perf_counter() - start:6.2f} s")

    def naive_edges() -> None:
        naive_distance(q, mass, edges, lengths, ones)
        naive_dihedral(q, mass, quads, angles, SHAPE_STIFFNESS)

    def naive() -> None:
        naive_edges()
        constraints.project_volume(q, mass, triangles, volume, 0.0, 1.0, gradient)

    def naive_volume() -> None:
        constraints.project_volume(q, mass, triangles, volume, 0.0, 1.0, gradient)

    variants: dict[str, Callable[[], object]] = {
        "naive scalar, atan2: distance and dihedral": naive_edges,
        "naive scalar: volume": naive_volume,
        "naive scalar, whole iteration": naive,
        "one by one, whole iteration": lambda: one_by_one.project(p, no_bones, bones_last=False),
        EDGES: sweep,
        WHOLE: lambda: batches.project(r, no_bones, bones_last=False),
    }
    times = interleaved(variants, rounds=100, clock=time.thread_time)
    naive_time = times["naive scalar, whole iteration"]
    print(f"\nadductor brevis, {len(triangles)} triangles, {len(edges)} edges, one core")
    for name, ms in times.items():
        ratio = f"{naive_time / ms:6.2f} x naive" if "whole" in name else ""
        print(f"  {name:50s} {ms:7.3f} ms {ratio}")
    parts = times["naive scalar, atan2: distance and dihedral"] / times[EDGES]
    print(f"  distance and dihedral alone: {parts:.2f} x naive")
    if pypbd is not None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "mesh.npz"
            np.savez(path, points=points, triangles=triangles, mass=mass, moved=moved)
            ours = {name: variants[name] for name in (EDGES, WHOLE)}
            compare_with_pypbd(pypbd, path, ours)


def compare_with_pypbd(python: str, mesh: Path, ours: Mapping[str, Callable[[], object]]) -> None:
    """Print the ratio of pypbd's iteration to ours: measured in turns, for its time varies."""
    other: list[float] = []
    ratios: dict[str, list[float]] = {name: [] for name in ours}
    with subprocess.Popen(
        [python, Path(__file__).with_name("pypbd_iteration.py"), mesh],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        for _ in range(TURNS):
            before = interleaved(ours, rounds=20, clock=time.thread_time)
            process.stdin.write("\n")
            process.stdin.flush()
            other.append(1e3 * float(process.stdout.readline().split()[-1]))
            after = interleaved(ours, rounds=20, clock=time.thread_time)
            for name, found in ratios.items():
                found.append(other[-1] / min(before[name], after[name]))
        process.stdin.close()
    print(f"  pypbd, distance and bending, one thread: median of {TURNS} turns {np.median(other):.3f} ms")
    for name, found in ratios.items():
        low, middle, high = np.percentile(found, [10, 50, 90])
        print(f"    {middle:5.1f} x {name} (10 % of the turns below {low:.1f}, 10 % above {high:.1f})")


def torus(n_triangles: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a bumpy closed surface of about so many triangles."""
    around = round((n_triangles / 2.0 / 3.0) ** 0.5)
    along = 3 * around
    i, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    u, v = 2.0 * np.pi * i / along, 2.0 * np.pi * j / around
    r = 10.0 + np.sin(7 * u) * np.cos(5 * v)
    points = np.stack([(30 + r * np.cos(v)) * np.cos(u), (30 + r * np.cos(v)) * np.sin(u), r * np.sin(v)], 2)
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = (i + 1) % along * around + j, (i + 1) % along * around + (j + 1) % around
    triangles = np.stack([a, c, b, b, c, d], axis=2).reshape(-1, 3)
    return points.reshape(-1, 3), triangles


def scaling(largest: int) -> None:
    """Print time per iteration, memory and time to build, from 1 000 triangles on, and a fit."""
    print("\n triangles  ms/iteration  ns/triangle   topology us   packing us   bytes/triangle (peak)")
    sizes, times = [], []
    for target in (1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 1_000_000):
        if target > largest:
            break
        points, triangles = torus(target)
        mass = np.ones(len(points))
        mass[: len(points) // 20] = 0.0
        topology = mesh_topology(len(points), triangles)
        build = {"topology": lambda p=points, t=triangles: mesh_topology(len(p), t)}
        shape = RestShape(points, topology)
        build["packing"] = lambda t=topology, s=shape, m=mass: pack(t, s, m)
        cost = interleaved(build, rounds=3)
        tracemalloc.start()
        order = ColourOrder(topology, shape, mass, stiffness(topology))
        held, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        p = points + 0.01 * np.sin(np.arange(points.size)).reshape(-1, 3)
        repeat = max(1, 100_000 // len(triangles))

        def run(order: ColourOrder = order, p: np.ndarray = p, repeat: int = repeat) -> None:
            for _ in range(repeat):
                order.project(p, no_bones, bones_last=False)

        ms = interleaved({"": run}, rounds=15)[""] / repeat
        sizes.append(len(triangles))
        times.append(ms)
        print(
            f"{len(triangles):10d} {ms:13.4f} {1e6 * ms / len(triangles):12.2f} "
            f"{1e3 * cost['topology'] / len(triangles):13.2f} {1e3 * cost['packing'] / len(triangles):12.2f} "
            f"{held / len(triangles):11.0f} {f'({peak / len(triangles):.0f})':>8s}"
        )
    if len(sizes) < 3:
        return
    slope, offset = np.polyfit(np.log(sizes), np.log(times), 1)
    print("  (bounds: topology 2 us, memory 600 bytes per triangle)")
    print(f"  fit: {np.exp(offset) * 1e6:.1f} ns x triangles^{slope:.3f} per iteration")


def main() -> None:
    """Run all measurements."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pypbd", metavar="PYTHON", help="a Python that has pypbd")
    parser.add_argument("--largest", type=int, default=1_000_000, help="most triangles")
    arguments = parser.parse_args()
    compare(arguments.pypbd)
    scaling(arguments.largest)


if __name__ == "__main__":
    main()
