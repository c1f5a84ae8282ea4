"""P21, Fig. 9: resolution of the mesh, 100 iterations, 40 degrees. ``python benchmarks/paper/p21_fig9.py``.

The distance is that of the points from the surface of the full mesh with the default settings and 100
iterations: coarse meshes lag less behind their bones. Roughness: see p21_fig8.py.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from common import P21, Case, Table, angles_up_to, data_folder, main, roughness, seen_alike, value

from vtkmuscle.core.coarse import decimate
from vtkmuscle.filters.arrays import checked_surface, points_of, surface_from
from vtkmuscle.filters.surface_distance import SurfaceDistance
from vtkmuscle.io import read_surface

FLEXION = 40.0


def meshes(case: Case) -> dict[str, Any]:
    """Return the muscle at three resolutions."""
    full = case.scene.muscles[case.adductor].surface
    if case.real:
        lite = data_folder() / "muscles_lite"
        coarse = [read_surface(lite / f"adductor_brevis_{n}.vtp") for n in (3000, 1000)]
    else:
        points, triangles = checked_surface(full, case.adductor)
        coarse = [surface_from(*decimate(points, triangles, n)) for n in (800, 400)]
    return dict(zip(("full", "L1", "L2"), (full, *coarse), strict=True))


def tables(case: Case) -> list[Table]:
    """Return time and quality of each resolution."""
    columns = ("mesh", "triangles", "iterations", "published [ms]", "P21's settings [ms]", "longest edge")
    columns += ("roughness [deg]", "distance, mean / p95 [mm]")
    table = Table(f"Fig. 9: {case.adductor} at 40 degrees", columns)
    flexion = 6.0 if case.short else FLEXION
    surfaces = meshes(case)
    reference = case.chain(case.adductor, iterations=10 if case.short else 100).pose(flexion)
    exact = SurfaceDistance(reference[1])
    runs = [("full", 100, 658.71), ("L1", 100, ""), ("L2", 100, ""), ("L2", 1000, 349.80), ("L2", 10000, "")]
    row = []
    for title, count, published in runs[:3] if case.short else runs:
        chain = case.chain(case.adductor, surface=surfaces[title], iterations=count, **P21)
        ms = float(np.median(chain.step_times(angles_up_to(flexion))))
        bones, muscle = chain.pose(flexion)
        far = exact.unsigned(points_of(muscle)) * case.scene.millimetres
        table.add(
            title,
            muscle.n_cells,
            count,
            published,
            f"{ms:.1f}",
            f"{value(muscle, 'EdgeStretchMax'):.1f}",
            f"{roughness(muscle):.1f}",
            f"{far.mean():.1f} / {np.percentile(far, 95):.1f}",
        )
        row.append((f"{muscle.n_cells} triangles, {count} iterations", (bones, muscle)))
    for title, surface in surfaces.items():
        chain = case.chain(case.adductor, surface=surface)
        ms = float(np.median(chain.step_times(angles_up_to(flexion))))
        bones, muscle = chain.pose(flexion)
        far = exact.unsigned(points_of(muscle)) * case.scene.millimetres
        table.add(
            f"{title}, defaults",
            muscle.n_cells,
            chain.deformer.iterations,
            "",
            f"{ms:.1f} (defaults)",
            f"{value(muscle, 'EdgeStretchMax'):.1f}",
            f"{roughness(muscle):.1f}",
            f"{far.mean():.1f} / {np.percentile(far, 95):.1f}",
        )
        row.append((f"{muscle.n_cells} triangles, defaults", (bones, muscle)))
    if case.draws:
        case.draw("p21_fig9.png", seen_alike([row]))
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
