# ruff: noqa: B023 -- all functions are called in the turn of the loop that makes them
"""Measure fibres at rest: what each step from the template on takes, what the settings cost, how cost grows.

Run as ``python benchmarks/bench_morphing.py [--no-growth] [--largest TRIANGLES]``. The four muscles of the
real hip are read from VTKMUSCLE_DATA; without them the first part is left out. Times are the least of several
rounds, the variants interleaved.
"""

from __future__ import annotations

import argparse
import time
import warnings

import igl
import numpy as np
from real_hip import data_folder
from timing import interleaved

from vtkmuscle import Scene
from vtkmuscle.core.mesh.surface import opposite_half_edges
from vtkmuscle.core.morphing.isolines import IsolineCourse, attachment_field, morph_by_isolines
from vtkmuscle.core.morphing.sections import ClosedSurface
from vtkmuscle.core.morphing.slices import Slicing, morph_by_planes
from vtkmuscle.core.template import TEMPLATES, sobol_points
from vtkmuscle.data.arrays import points_of, triangles_of, with_points
from vtkmuscle.filters import (
    FibreSmoother,
    FibreTemplateSource,
    SliceMorpher,
    TemplateFitter,
    attachments_from,
)
from vtkmuscle.phantoms import hip

ROUNDS = 7
#: What planes may take, by the number of fibres [ms].
BOUND = {100: 10, 1000: 100}
#: Harmonic morphing of a tube, for the growth of cost: fibres, and triangles.
FIBRES = (100, 1000, 10_000)
TRIANGLES = (10_000, 100_000, 1_000_000)


def outside(points: np.ndarray, surface: np.ndarray, triangles: np.ndarray) -> tuple[int, float]:
    """Return how many points are more than 0.1 mm outside of a surface, and the largest distance [mm]."""
    distances = np.sqrt(igl.point_mesh_squared_distance(points, surface, triangles)[0])
    out = igl.fast_winding_number(surface, triangles, points) < 0.5
    return int((out & (distances > 0.1)).sum()), float(distances[out].max(initial=0.0))


def largest_turn(points: np.ndarray, n_fibres: int) -> float:
    """Return the largest angle between successive segments [degrees]."""
    steps = np.diff(points.reshape(n_fibres, -1, 3), axis=1)
    steps /= np.maximum(np.linalg.norm(steps, axis=2, keepdims=True), 1e-300)
    return float(np.degrees(np.arccos((steps[:, 1:] * steps[:, :-1]).sum(axis=2).clip(-1, 1))).max())


def real_muscles(n_fibres: int, resolution: int) -> None:
    """Print what each step takes on the four muscles of the real hip, and what the result is worth."""
    scene = Scene.load(data_folder() / "scene.toml")
    print(f"{n_fibres} fibres x {resolution} segments [ms]")
    for name, muscle in scene.muscles.items():
        areas = attachments_from(muscle.attachments)
        surface = muscle.surface
        template = FibreTemplateSource(n_fibres=n_fibres, resolution=resolution).update().output
        fitted = TemplateFitter()(template, surface, areas)
        points, triangles = points_of(surface), triangles_of(surface, "bench")
        morphers = {
            "plane": lambda: SliceMorpher(method="plane")(fitted, surface),
            "harmonic": lambda: SliceMorpher(method="harmonic")(fitted, surface, areas),
        }
        fibres = {label: run() for label, run in morphers.items()}
        times = interleaved(
            {
                "template": lambda: FibreTemplateSource(n_fibres=n_fibres, resolution=resolution).update(),
                "fit, one axis": lambda: TemplateFitter(axis="attachments")(template, surface, areas),
                "fit, auto": lambda: TemplateFitter()(template, surface, areas),
                **morphers,
                "smooth": lambda: FibreSmoother()(fibres["plane"]),
            },
            rounds=ROUNDS,
        )
        print(f"{name}, {len(triangles)} triangles")
        print("  " + ", ".join(f"{label} {t:.1f}" for label, t in times.items() if label not in morphers))
        for label, morphed in fibres.items():
            count, farthest = outside(points_of(morphed), points, triangles)
            smooth = points_of(FibreSmoother()(morphed))
            print(
                f"  {label:21} {times[label]:6.1f} ms; {count:4} points outside by more than 0.1 mm, at most "
                f"{farthest:.2f}; largest turn {largest_turn(smooth, n_fibres):.0f} degrees after smoothing"
            )
        base = times["template"] + times["fit, one axis"] + times["smooth"]
        print(
            f"  to smoothed fibres: plane {base + times['plane']:.1f} (bound {BOUND[n_fibres]}), harmonic "
            f"{base + times['harmonic']:.1f} (bound 60)"
        )


def four_muscles() -> None:
    """Print the time of the job of Kohout et al. 2012: four muscles, 50 fibres each (published: 300 ms)."""
    scene = Scene.load(data_folder() / "scene.toml")
    muscles = [(muscle.surface, attachments_from(muscle.attachments)) for muscle in scene.muscles.values()]

    def job() -> None:
        for surface, areas in muscles:
            template = FibreTemplateSource(n_fibres=50, resolution=14)()
            fitted = TemplateFitter(axis="attachments")(template, surface, areas)
            FibreSmoother()(SliceMorpher(method="plane")(fitted, surface))

    print(
        f"four muscles x 50 x 14 [ms]: {interleaved({'plane': job}, rounds=ROUNDS)['plane']:.1f} (bound 25)"
    )


def tolerances() -> None:
    """Print what slices that heights share save and cost, on curved fibres of the phantom hip."""
    muscle = Scene.from_phantom(hip()).muscles["gluteus_maximus"]
    areas = attachments_from(muscle.attachments)
    template = FibreTemplateSource(template="curved", n_fibres=200, resolution=15).update().output
    # Heights of their own for each fibre, as those of fibres that were trimmed have.
    points = points_of(template).reshape(200, -1, 3)
    points[..., 2] = points[..., 2] ** (1.0 + 0.2 * np.linspace(-1, 1, 200)[:, None])
    fitted = TemplateFitter()(with_points(template, points.reshape(-1, 3)), muscle.surface, areas)

    def morphed(tolerance: float) -> tuple[np.ndarray, float]:
        began = time.process_time()
        fibres = SliceMorpher(method="plane", slice_tolerance=tolerance)(fitted, muscle.surface)
        return points_of(fibres), 1e3 * (time.process_time() - began)

    morphed(20.0)  # compiles
    print(
        "slice_tolerance [mm]: time [ms], median, 95th percentile and largest error [mm], 200 fibres x 15 "
        "segments of unequal heights"
    )
    exact = np.empty(0)
    for tolerance in (0.0, 0.1, 0.3, 1.0, 3.0, 10.0):
        points, _ = morphed(tolerance)
        exact = exact if len(exact) else points
        least = min(morphed(tolerance)[1] for _ in range(3))
        parts = np.percentile(np.linalg.norm(points - exact, axis=1), (50, 95, 100))
        print(f"  {tolerance:5.1f}: {least:7.1f}, " + ", ".join(f"{part:.4f}" for part in parts))


def growth(largest: int) -> None:
    """Print how the cost of both methods grows with fibres and with triangles."""
    print("growth on a bent tube: [ms] planes, isolines, their function and course once")
    cases = [(n, TRIANGLES[0]) for n in FIBRES] + [(100, n) for n in TRIANGLES[1:] if n <= largest]
    measured = []
    for n_fibres, n_triangles in cases:
        sides = round((n_triangles / 8) ** 0.5)
        points, triangles, origin, insertion = _tube(4 * sides, sides)
        low, high = points.min(axis=0), points.max(axis=0)
        box = np.diag([*(high - low), 1.0])
        box[:3, 3] = low
        template = (
            TEMPLATES["parallel"].fibres(*sobol_points(n_fibres).T, np.linspace(0, 1, 16)).reshape(-1, 3)
        )
        fitted = template * (high - low) + low
        field = attachment_field(points, triangles, origin, insertion)
        muscle = ClosedSurface(points, triangles, opposite_half_edges(triangles))
        course = IsolineCourse(muscle, field)
        slicing = Slicing(slice_tolerance=0.1, continuity=0.2)
        times = interleaved(
            {
                "planes": lambda s=muscle: morph_by_planes(fitted, box, s, slicing),
                "isolines": lambda s=course: morph_by_isolines(fitted, box, s, slicing),
                "field": lambda s=muscle, ends=(origin, insertion): IsolineCourse(
                    s, attachment_field(s.points, s.triangles, *ends)
                ),
            },
            rounds=1 if n_triangles > 200_000 else 3,
            clock=time.thread_time,
        )
        measured.append((n_fibres, len(triangles), *times.values()))
        print(
            f"  {n_fibres:6} fibres, {len(triangles):8} triangles: "
            + ", ".join(f"{t:.1f}" for t in times.values())
        )
    table = np.array(measured)
    for name, column, rows in (
        ("fibres", 0, table[:, 1] == table[0, 1]),
        ("triangles", 1, table[:, 0] == FIBRES[0]),
    ):
        if rows.sum() > 1:
            x, y = table[rows, column], table[rows, 2:]
            powers = np.log(y[-1] / y[-2]) / np.log(x[-1] / x[-2])
            per = (y[-1] - y[0]) / (x[-1] - x[0])
            print(
                f"  with {name}: time grows as their power "
                + ", ".join(f"{power:.2f}" for power in powers)
                + " (linear: 1) at the largest, "
                + ", ".join(f"{1e3 * each:.2f}" for each in per)
                + " us each"
            )


def _tube(n_rings: int, sides: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return a closed round muscle along z that leans aside in its middle, and the rims of its ends."""
    z = np.linspace(0.0, 150.0, n_rings)
    turn = 2.0 * np.pi * np.arange(sides) / sides
    radius = 8.0 + 8.0 * np.sin(np.pi * z / 150.0)
    x = 20.0 * np.sin(np.pi * z / 150.0)[:, None] + radius[:, None] * np.cos(turn)
    rings = np.stack([x, radius[:, None] * np.sin(turn), np.repeat(z[:, None], sides, axis=1)], axis=2)
    ids = np.arange(n_rings * sides).reshape(n_rings, sides)
    a, b = ids[:-1], np.roll(ids[:-1], -1, axis=1)
    c, d = ids[1:], np.roll(ids[1:], -1, axis=1)
    first, last = n_rings * sides, n_rings * sides + 1
    triangles = np.vstack(
        [
            np.stack([a, b, c], axis=2).reshape(-1, 3),
            np.stack([b, d, c], axis=2).reshape(-1, 3),
            np.column_stack([np.roll(ids[0], -1), ids[0], np.full(sides, first)]),
            np.column_stack([ids[-1], np.roll(ids[-1], -1), np.full(sides, last)]),
        ]
    )
    points = np.vstack([rings.reshape(-1, 3), [[0.0, 0.0, 0.0], [0.0, 0.0, 150.0]]])
    return points, triangles, np.append(ids[0], first), np.append(ids[-1], last)


def main() -> None:
    """Print all measurements."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--no-growth", action="store_true", help="leave out the growth of cost")
    parser.add_argument("--largest", type=int, default=TRIANGLES[-1], help="triangles of the largest muscle")
    arguments = parser.parse_args()
    # The mean value map warns of the points that are counted here.
    warnings.filterwarnings("ignore", message="SliceMorpher: the mean value map")
    if (data_folder() / "scene.toml").is_file():
        real_muscles(100, 15)
        real_muscles(1000, 30)
        four_muscles()
    tolerances()
    if not arguments.no_growth:
        growth(arguments.largest)


if __name__ == "__main__":
    main()
