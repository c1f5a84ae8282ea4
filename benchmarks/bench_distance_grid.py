"""Measure distance grids on the bones of a hip: error, signs, speed of look-up, time to build, memory.

Run as ``python benchmarks/bench_distance_grid.py [folder]``, where the folder holds ``scene.toml`` (by
default that of ``VTKMUSCLE_DATA``, else ``../shared/data``, and there ``lhdl_hip``).

Times to build are the least of three; they are given in seconds of wall clock and of processor. Bones are
measured along their own axes, whole and where the muscles of the scene can reach.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

import igl
import numpy as np

from vtkmuscle import Scene
from vtkmuscle.core.collision.distance_collision import resolve_distance_collisions
from vtkmuscle.core.collision.distance_grid import build_distance_grid
from vtkmuscle.core.collision.distance_lookup import signed_distance
from vtkmuscle.core.collision.distance_obstacle import DistanceObstacle
from vtkmuscle.core.mesh.closed_shells import closed_shells
from vtkmuscle.data.arrays import checked_surface, field_array
from vtkmuscle.run.reach import bones_with_reach


def exact_distance(points, triangles, queries):
    """Return the least signed distance from the shells, by libigl."""
    surface = closed_shells(points, triangles)
    distances = []
    for shell in surface.shells:
        used, numbers = np.unique(shell, return_inverse=True)
        signed = igl.signed_distance(
            queries,
            surface.points[used],
            numbers.reshape(-1, 3),
            sign_type=igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL,
        )
        distances.append(signed[0])
    return np.min(distances, axis=0)


def near_surface(points, triangles, rng, *, count, distance):
    """Return points spread evenly over the surface, at most a distance along the normal from it."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    chosen = rng.choice(len(triangles), count, p=areas / areas.sum())
    weights = rng.dirichlet([1.0, 1.0, 1.0], count)
    on_surface = np.einsum("ij,ijk->ik", weights, points[triangles[chosen]])
    return on_surface + rng.uniform(-distance, distance, (count, 1)) * normals[chosen] / areas[chosen, None]


def best_time(work, *, repeats=5, clock=time.perf_counter):
    """Return the least time that a work takes [s]."""
    times = []
    for _ in range(repeats):
        start = clock()
        work()
        times.append(clock() - start)
    return min(times)


def measure_error(name, bone, rng, *, cell):
    """Print how far a grid is off, and what a push leaves inside."""
    grid = build_distance_grid(*bone, cell=cell)
    for distance in (1.0, grid.band - cell):
        queries = near_surface(*bone, rng, count=100_000, distance=distance)
        exact = exact_distance(*bone, queries)
        error = np.abs(signed_distance(grid, queries) - exact)
        wrong = np.mean((signed_distance(grid, queries) < 0) != (exact < 0))
        p50, p95, p99 = np.percentile(error, [50, 95, 99])
        print(
            f"{name:8s} cell {cell:3.1f} mm, within {distance:4.2f} mm: error p50 {p50:.4f} p95 {p95:.4f} "
            f"p99 {p99:.4f} max {error.max():.3f} mm, wrong sign {100 * wrong:.3f} %, "
            f"{grid.nbytes / 1e6:.1f} MB"
        )
    # A step that presses points of the surface a millimetre into the bone, and what is left after one call.
    start = near_surface(*bone, rng, count=20_000, distance=0.0)
    end = start + rng.normal(scale=1.0, size=start.shape)
    free = np.ones(len(end), dtype=bool)
    seconds = time.perf_counter()
    moved = resolve_distance_collisions(grid, np.eye(4), np.eye(4), start, end, free)
    seconds = time.perf_counter() - seconds
    depth = np.maximum(0.0, -exact_distance(*bone, end))
    print(
        f"{name:8s} cell {cell:3.1f} mm, after a push of {moved.sum()} of {len(end)} points: exact depth p95 "
        f"{np.percentile(depth[moved], 95):.4f} p99 {np.percentile(depth[moved], 99):.4f} max "
        f"{depth.max():.3f} mm, {1e6 * seconds / len(end):.2f} microseconds a point"
    )


def measure_lookup(bone, rng, *, cell):
    """Print the speed of look-ups on one core."""
    grid = build_distance_grid(*bone, cell=cell)
    count = 2_000_000
    near = near_surface(*bone, rng, count=count, distance=1.0)
    blocks = np.lexsort(tuple(np.floor(near / 10.0).T))
    box = grid.origin + rng.random((count, 3)) * np.array(grid.dims) * grid.cell
    for name, queries in (
        ("near the surface, as on a muscle", np.ascontiguousarray(near[blocks])),
        ("near the surface, shuffled", near),
        ("anywhere in the grid", box),
    ):
        seconds = best_time(lambda queries=queries: signed_distance(grid, queries), clock=time.thread_time)
        print(f"look-up, {name}: {count / seconds / 1e6:.0f} million points a second")


def measure_build(scene, *, cell):
    """Print how long grids take to build and to read, and their memory; a cell of None is the default."""
    surfaces = [
        (*checked_surface(bone, name), field_array(bone, "Reach"))
        for name, bone in bones_with_reach(scene).items()
    ]

    def obstacles(reach):
        return [
            DistanceObstacle(0, points, triangles, cell=cell, reach=corners if reach else None)
            for points, triangles, corners in surfaces
        ]

    def build(reach):
        return [obstacle.grid for obstacle in obstacles(reach)]

    sizes = " and ".join(f"{obstacle.cell:.2f}" for obstacle in obstacles(True))
    for what, reach in (("whole", False), ("in reach", True)):
        os.environ["VTKMUSCLE_CACHE"] = ""
        wall = best_time(lambda reach=reach: build(reach), repeats=3)
        processor = best_time(lambda reach=reach: build(reach), repeats=3, clock=time.process_time)
        size = sum(grid.nbytes for grid in build(reach)) / 1e6
        with tempfile.TemporaryDirectory() as folder:
            os.environ["VTKMUSCLE_CACHE"] = folder
            build(reach)
            cached = best_time(lambda reach=reach: build(reach))
        print(
            f"both bones, {what}, cells of {sizes} mm: built in {wall:.2f} s, processor {processor:.2f} s, "
            f"from the cache in {cached:.3f} s, {size:.1f} MB"
        )


def main():
    """Measure all."""
    data = Path(os.environ.get("VTKMUSCLE_DATA", Path(__file__).parents[2] / "shared" / "data"))
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else data / "lhdl_hip"
    if not folder.is_dir():
        sys.exit(f"no data: {folder} is not a folder")
    scene = Scene.load(folder / "scene.toml")
    bones = {name: checked_surface(bone, name) for name, bone in scene.bones.items()}
    rng = np.random.default_rng(1)
    for cell in (1.3, 1.0):
        for name, bone in bones.items():
            measure_error(name, bone, rng, cell=cell)
    for cell in (None, 1.3, 1.0):
        measure_build(scene, cell=cell)
    measure_lookup(bones["pelvis"], rng, cell=1.3)


if __name__ == "__main__":
    main()
