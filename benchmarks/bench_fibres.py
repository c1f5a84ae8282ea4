"""Measure fibres on the real hip: time of each stage, lengths, coverage, turns, points outside, transport.

Run as ``python benchmarks/bench_fibres.py [--muscles NAME ...] [--sizes] [--transport]``. Times
are of the processor, the least of several runs with new filters, everything compiled, and what is remembered
of a muscle (search tree, attachment patches, sections and their maps) in place; the first run, which has to
find those out, is printed too.
"""

from __future__ import annotations

import argparse
import time
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from real_hip import data_folder
from scipy.spatial import cKDTree

from vtkmuscle import Scene
from vtkmuscle.core.bones.bone import bone_of, depth_in
from vtkmuscle.core.fibres.embedding import sparse_mean_value_coordinates, sparse_transport
from vtkmuscle.core.fibres.mean_value import transport
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.data.arrays import blocks_of, cell_array, checked_surface, field_array, polylines_of
from vtkmuscle.data.muscle_geometry import MuscleGeometry, surface_of
from vtkmuscle.filters import (
    FibreMetrics,
    FibreSmoother,
    FibreTemplateSource,
    FibreTrimmer,
    SliceMorpher,
    TemplateFitter,
)

Floats = NDArray[np.float64]

STAGES = ("template", "fit", "morph", "trim", "smooth")
#: Random points in a muscle for the coverage.
SAMPLES = 20_000
#: Sections of a muscle for the same.
SECTIONS = 30


def staged(
    muscle: object,
    attachments: object,
    n_fibres: int,
    resolution: int,
    spreading: float | None = None,
) -> tuple[object, list[float]]:
    """Return fibres from new filters, and what each stage took [ms]."""
    times = [time.thread_time()]
    template = FibreTemplateSource(n_fibres=n_fibres, resolution=resolution)()
    times.append(time.thread_time())
    fitted = TemplateFitter()(template, muscle, attachments)
    times.append(time.thread_time())
    morphed = SliceMorpher()(fitted, muscle, attachments)
    times.append(time.thread_time())
    trimmed = FibreTrimmer()(morphed, muscle, attachments)
    times.append(time.thread_time())
    smoothed = FibreSmoother(spreading=spreading)(trimmed, muscle, attachments)
    times.append(time.thread_time())
    return smoothed, (1e3 * np.diff(times)).tolist()


def coverage(fibres: object, muscle: object) -> tuple[float, float, float]:
    """Return the 95th percentile of the distance of points in a muscle from a fibre, and two ideals.

    The first ideal is as many fibres evenly spaced in each section of the muscle from end to end, in
    hexagonal packing: a random point in a hexagon of inner radius r is nearer than 1.035 r to its centre in
    95 % of cases (by sampling, below), and r follows the area of the sections across the muscle's course
    (by the sections across its longest side, times the cosine of the course's angle to that side). The second
    has the same spacing everywhere, and fibres of the same total length: a lower bound of what any
    fibres can do, for it has fibres begin and end within the muscle wherever it widens or tapers.
    """
    lines = polylines_of(fibres, "fibres")
    geometry = surface_of(muscle, "muscle").geometry
    inside = random_points(geometry)
    dense = []
    for first, last in pairwise(lines.offsets):
        line = lines.points[first:last]
        for a, b in pairwise(line):
            dense.append(a + np.linspace(0, 1, 12, endpoint=False)[:, None] * (b - a))
        dense.append(line[-1:])
    found = np.percentile(cKDTree(np.vstack(dense)).query(inside)[0], 95)
    volume = abs(signed_volume(geometry.points, geometry.triangles))
    rng = np.random.default_rng(0)
    place = rng.uniform(-1.2, 1.2, (4 * SAMPLES, 2))
    turned = [np.abs(place @ [np.cos(t), np.sin(t)]) <= 1 for t in np.pi / 3 * np.arange(3)]
    in_hexagon = np.linalg.norm(place[np.all(turned, axis=0)], axis=1)
    even = np.sqrt(volume / (12.0**0.5 * polyline_lengths(lines.points, lines.offsets).sum()))
    side = np.linalg.svd(inside - inside.mean(axis=0), full_matrices=False)[2][0]
    heights = inside @ side
    edges = np.linspace(heights.min(), heights.max(), SECTIONS + 1)
    section = np.clip(np.searchsorted(edges, heights) - 1, 0, SECTIONS - 1)
    counts = np.bincount(section, minlength=SECTIONS)
    sums = np.column_stack([np.bincount(section, x, SECTIONS) for x in inside.T])
    course = np.gradient(sums / np.maximum(counts, 1)[:, None], axis=0)
    cosines = np.abs(course @ side) / np.maximum(np.linalg.norm(course, axis=1), 1e-12)
    area = volume * counts / len(inside) / (edges[1] - edges[0]) * cosines
    radii = np.sqrt(area / (2 * np.sqrt(3) * len(lines)))
    ideal = np.percentile(radii[section] * rng.choice(in_hexagon, len(inside)), 95)
    return float(found), float(ideal), float(even * np.percentile(in_hexagon, 95))


def random_points(geometry: MuscleGeometry) -> Floats:
    """Return points in a muscle that have nothing to do with those by which fibres are spread."""
    rng = np.random.default_rng(1)
    low, high = geometry.points.min(axis=0), geometry.points.max(axis=0)
    found = np.empty((0, 3))
    while len(found) < SAMPLES:
        places = rng.uniform(low, high, (4 * SAMPLES, 3))
        found = np.vstack([found, places[geometry.solids.inside(places)]])
    return found[:SAMPLES]


def quality(name: str, fibres: object, muscle: object, bones: object) -> None:
    """Print lengths, turns, points outside, coverage and penetration of fibres."""
    measured = FibreMetrics(architecture=True)(fibres, muscle)
    lines = polylines_of(fibres, "fibres")
    steps = np.diff(lines.points.reshape(len(lines), -1, 3), axis=1)
    steps /= np.linalg.norm(steps, axis=2, keepdims=True)
    turns = np.degrees(np.arccos(np.clip((steps[:, 1:] * steps[:, :-1]).sum(axis=2), -1, 1)))
    signed = surface_of(muscle, "muscle").geometry.solids.distances(lines.points)
    outside = np.maximum(signed, 0.0)
    found, ideal, even = coverage(fibres, muscle)
    length = cell_array(measured, "Length", "fibres")
    shapes = [bone_of(*checked_surface(bone, label)) for label, bone in blocks_of(bones)]
    depths = depth_in(((bone, np.eye(4)) for bone in shapes), lines.points)
    entered = np.maximum.reduceat(depths, lines.offsets[:-1])
    print(
        f"{name:16s} length {length.mean():6.1f} mm, sd {length.std():.1f}, {length.min():.1f} to "
        f"{length.max():.1f}; largest turn {turns.max():.0f} deg; {(outside > 0.1).sum()} of {outside.size} "
        f"points more than 0.1 mm outside; p95 to the nearest fibre {found:.2f} mm = {found / ideal:.2f} x "
        f"ideal ({found / even:.2f} x if spacing were the same in all sections); "
        f"{int((entered > 0.5).sum())} fibres more than 0.5 mm in bone, deepest "
        f"{entered.max():.2f} mm; PCSA {field_array(measured, 'PCSA')[0]:.0f} mm^2"
    )


def time_transport(fibres: object, muscle: object) -> None:
    """Print what weights and a frame take, by which of the weights are dropped, and what that costs."""
    points, triangles = checked_surface(muscle, "muscle")
    queries = polylines_of(fibres, "fibres").points
    centred = points - points.mean(axis=0)
    size = np.linalg.norm(np.ptp(points, axis=0))
    bent = centred + centred[:, 2:] ** 2 / (2 * size) * [1.0, 0.5, 0.0]
    exact = None
    for prune in (0.0, 0.03, 0.1, 0.3, 1.0, 3.0):
        started = time.perf_counter(), time.process_time()
        weights = sparse_mean_value_coordinates(points, triangles, queries, prune=prune)
        took, cpu = time.perf_counter() - started[0], time.process_time() - started[1]
        frame = least(lambda weights=weights: sparse_transport(weights, bent))
        moved = sparse_transport(weights, bent)
        exact = moved if exact is None else exact
        error = np.linalg.norm(moved - exact, axis=1)
        megabytes = (weights.matrix.data.nbytes + weights.matrix.indices.nbytes) / 1e6
        print(
            f"  prune {prune:5.2f}: weights {took:.2f} s ({cpu:.2f} s of processor), {megabytes:6.1f} MB, "
            f"frame {frame:5.1f} ms; bent by a radian: error {error.mean():.3f} mm, max {error.max():.3f}, "
            f"reported {weights.error:.3f}"
        )
    dense = np.random.default_rng(0).random((len(queries), len(points)))
    print(
        f"  dense product, {dense.nbytes / 1e6:.0f} MB: frame {least(lambda: transport(dense, bent)):.1f} ms"
    )


def least(run: object, rounds: int = 7) -> float:
    """Return the least time of some runs [ms]."""
    best = np.inf
    for _ in range(rounds):
        start = time.perf_counter()
        run()  # type: ignore[operator]
        best = min(best, time.perf_counter() - start)
    return 1e3 * best


def main() -> None:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--muscles", nargs="*", help="default: all of the scene")
    parser.add_argument("--resolution", type=int, default=15, metavar="N", help="segments of a fibre (15)")
    parser.add_argument("--sizes", action="store_true", help="up to 10 000 fibres")
    parser.add_argument("--transport", action="store_true", help="weights and frames, on the first muscle")
    parser.add_argument("--rounds", type=int, default=7)
    options = parser.parse_args()
    scene = Scene.load(data_folder() / "scene.toml")
    names = options.muscles or list(scene.muscles)
    bones = scene.bones_data()
    for name in names:
        muscle, attachments = scene.muscles[name].surface, scene.attachments_data(name)
        given = muscle, attachments, 100, options.resolution
        _, first = staged(*given)
        runs = [staged(*given) for _ in range(options.rounds)]
        fibres = runs[0][0]
        best = np.min([times for _, times in runs], axis=0)
        stages = ", ".join(f"{stage} {ms:.1f}" for stage, ms in zip(STAGES, best, strict=True))
        size = f"{name:16s} 100 x {options.resolution}"
        print(f"{size}: {best.sum():.1f} ms ({stages}); first run {sum(first):.0f} ms")
        quality(name, fibres, muscle, bones)
        if name == names[0] and options.transport:
            time_transport(fibres, muscle)
    if options.sizes:
        muscle, attachments = scene.muscles[names[0]].surface, scene.attachments_data(names[0])
        for count, resolution in ((1, 15), (50, 14), (100, 1), (100, 1000), (1000, 30), (10_000, 15)):
            best = np.min([staged(muscle, attachments, count, resolution)[1] for _ in range(3)], axis=0)
            stages = ", ".join(f"{stage} {ms:.1f}" for stage, ms in zip(STAGES, best, strict=True))
            print(f"{names[0]} {count} x {resolution}: {best.sum():.1f} ms ({stages})")


if __name__ == "__main__":
    main()
