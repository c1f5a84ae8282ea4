"""Measure the fields of the bones of a hip: error, signs, what a push leaves inside, time, memory.

Run as ``python benchmarks/bench_bones.py [folder]``, where the folder holds ``scene.toml`` (by default that
of ``VTKMUSCLE_DATA``, else ``../shared/data``, and there ``lhdl_hip``). Times are of the processor.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np

from vtkmuscle import Scene
from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.bones.contact import BoneContact, PoseContact
from vtkmuscle.data.arrays import checked_surface

#: Cells that are compared [mm]; None for that of the bone's size.
CELLS = (0.5, 1.0, None, 2.0, 4.0)

#: Points of a muscle's taut fibres, which are looked up together.
TOGETHER = 3000


def near_surface(points, triangles, rng, *, count, distance):
    """Return points spread evenly over the surface, at most a distance along the normal from it."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    chosen = rng.choice(len(triangles), count, p=areas / areas.sum())
    weights = rng.dirichlet([1.0, 1.0, 1.0], count)
    on_surface = np.einsum("ij,ijk->ik", weights, points[triangles[chosen]])
    return on_surface + rng.uniform(-distance, distance, (count, 1)) * normals[chosen] / areas[chosen, None]


def seconds_of(work, *, repeats=1):
    """Return the least time of the processor that a work takes [s]."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def measure(name, surface, rng, *, cell):
    """Print the figures of a bone."""
    bone = Bone(*surface, cell=cell)
    queries = near_surface(*surface, rng, count=50_000, distance=1.0)
    seconds = seconds_of(lambda: bone.field(queries))
    exact, found = bone.solids.exact(queries)[0], bone.field(queries)[0]
    p50, p95, worst = np.percentile(np.abs(found - exact), [50, 95, 100])
    wrong = np.mean((found < 0) != (exact < 0))
    print(
        f"{name:8s} cell {bone.cell:4.2f} mm: error p50 {p50:.4f} p95 {p95:.4f} max {worst:.3f} "
        f"mm, wrong sign {100 * wrong:.3f} %, "
        f"whole surface filled in {seconds:.2f} s, {np.count_nonzero(bone.look_up().nodes)} nodes"
    )
    # A step that presses points of the surface a millimetre into the bone, and what is left after one call.
    start = near_surface(*surface, rng, count=20_000, distance=0.0)
    end = start + rng.normal(scale=1.0, size=start.shape)
    free = np.ones(len(end), dtype=bool)
    contact = BoneContact({0: bone}, start, free)
    moved = PoseContact(contact, np.eye(4)[None], [], np.zeros(3)).keep_out(end)
    depth = bone.depth(end)
    print(
        f"{name:8s} cell {bone.cell:4.2f} mm, {moved.sum()} of {len(end)} points pushed out: exact depth p95 "
        f"{np.percentile(depth, 95):.4f} max {depth.max():.3f} mm"
    )
    some = queries[np.lexsort(tuple(np.floor(queries / 10.0).T))][:TOGETHER]
    look_up, measured = (
        seconds_of(lambda ask=ask: ask(some), repeats=20) for ask in (bone.field, bone.exact)
    )
    print(
        f"{name:8s} cell {bone.cell:4.2f} mm, {TOGETHER} points: looked up in {1e3 * look_up:.2f} ms, "
        f"measured in {measured / look_up:.0f} times that"
    )


if __name__ == "__main__":
    data = Path(os.environ.get("VTKMUSCLE_DATA", Path(__file__).parents[2] / "shared" / "data")) / "lhdl_hip"
    scene = Scene.load((Path(sys.argv[1]) if len(sys.argv) > 1 else data) / "scene.toml")
    for name, bone in scene.bones.items():
        for cell in CELLS:
            measure(name, checked_surface(bone, name), np.random.default_rng(0), cell=cell)
