"""Kohout and Červenka 2021, Fig. 9: resolution of the mesh, 100 iterations, 40 degrees.

The distance is that of the points from the surface of the full mesh by the default model. Roughness: see
kohout2021_fig8.py; times and plain iterations: see kohout2021_times.py. The second table asks why coarse
meshes look better as printed: how many edges lie between the muscle's ends, which is how far each iteration
is from carrying a bone's motion through, and how far the muscle still moves on once they stand still.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from common import (
    LEFT,
    PATHS,
    PRINTED,
    STABLE,
    STEP,
    Case,
    Chain,
    Table,
    angles_up_to,
    data_folder,
    main,
    rms,
    roughness,
    seen_alike,
    value,
)
from kohout2021_times import cell
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from vtkmuscle import RigidMotion
from vtkmuscle.core.mesh.solids import Solids, solids_of
from vtkmuscle.core.mesh.surface import edge_lengths, mesh_topology
from vtkmuscle.data.arrays import checked_surface, point_array, points_of
from vtkmuscle.io import read_surface

FLEXION = 40.0
#: Iterations of the paper, and the steps with the bones still that show how far a muscle lags behind.
ITERATIONS, HELD = 100, 100


def meshes(case: Case) -> dict[str, Any]:
    """Return the muscle at three resolutions."""
    full = case.scene.muscles[case.adductor].surface
    if case.real:
        lite = data_folder() / "muscles_lite"
        coarse = [read_surface(lite / f"adductor_brevis_{n}.vtp") for n in (3000, 1000)]
    else:
        triangles = pv.wrap(full).n_cells  # of a closed surface: twice as many as points
        coarse = [pv.wrap(full).decimate(1.0 - 2.0 * n / triangles) for n in (800, 400)]
    return dict(zip(("full", "L1", "L2"), (full, *coarse), strict=True))


def edges_between_ends(muscle: Any) -> tuple[int, float]:
    """Return the least and the mean number of edges from points fixed to the last bone to the others."""
    points, triangles = checked_surface(muscle, "muscle")
    fixed_to = point_array(muscle, "FixedTo", "muscle")
    edges = mesh_topology(len(points), triangles).edges
    ones = np.ones(len(edges))
    graph = coo_matrix((ones, (edges[:, 0], edges[:, 1])), shape=(len(points), len(points))).tocsr()
    ends = [np.flatnonzero(fixed_to == bone) for bone in np.unique(fixed_to[fixed_to >= 0])]
    steps = dijkstra(graph, directed=False, indices=ends[-1], unweighted=True, min_only=True)
    return int(steps[ends[0]].min()), float(steps[ends[0]].mean())


def moved_on(case: Case, surface: Any, flexion: float, held: int) -> tuple[Any, Any, Any]:
    """Return the muscle with its fixed points, at a flexion, and after more steps with the bones still.

    The last is None where the muscle leaves the range of numbers on the way.
    """
    reached = round(flexion / STEP)
    frames = [*range(reached + 1), *[reached] * held]
    poses = {bone: np.asarray(every)[frames] for bone, every in case.motion.transforms.items()}
    motion = RigidMotion(np.arange(float(len(frames))), poses)
    settings = {"iterations": ITERATIONS, "measure_shape": True}
    chain = case.chain(case.adductor, PRINTED, surface=surface, motion=motion, **settings)
    deformer = chain.deformer
    now = pv.wrap(deformer.update(time=float(reached)).output).copy()
    try:
        later = pv.wrap(deformer.update(time=float(reached + held)).output).copy()
    except ValueError:
        later = None
    return chain.fixed, now, later


def why(case: Case, surfaces: dict[str, Any], flexion: float) -> Table:
    """Return how far each resolution lags behind its bones: how far it goes on when they stand still."""
    held = 2 if case.short else HELD
    columns = ("mesh", "edges from insertion to origin, least / mean", "shortest edge of free points [mm]")
    columns += (f"moves in {held} more steps, bones still: rms [mm]", "longest edge", "then")
    table = Table("Why coarse meshes look better: how far they lag behind their bones", columns)
    for title, surface in surfaces.items():
        marked, now, later = moved_on(case, surface, flexion, held)
        least, mean = edges_between_ends(marked)
        table.add(
            title,
            f"{least} / {mean:.0f}",
            f"{shortest_free_edge(marked) * case.scene.millimetres:.3f}",
            LEFT if later is None else f"{rms(now, later) * case.scene.millimetres:.3g}",
            f"{value(now, 'EdgeStretchMax'):.3g}",
            "" if later is None else f"{value(later, 'EdgeStretchMax'):.3g}",
        )
    return table


def shortest_free_edge(muscle: Any) -> float:
    """Return the length of the shortest edge with a free point."""
    points, triangles = checked_surface(muscle, "muscle")
    edges = mesh_topology(len(points), triangles).edges
    free = (point_array(muscle, "FixedTo", "muscle")[edges] < 0).any(axis=1)
    return float(edge_lengths(points, edges[free]).min())


def add(
    table: Table,
    chain: Chain,
    flexion: float,
    exact: tuple[Solids, float],
    title: str,
    *cells: object,
) -> tuple[str, Any]:
    """Add a row of a mesh to the table; return its title and pose for a picture."""
    ms = cell(*chain.step_time(angles_up_to(min(flexion, 16.0))))
    chain.deformer.measure_shape = True
    triangles, pose = chain.fixed.GetNumberOfCells(), chain.pose(flexion)
    label = f"{title}: {triangles} triangles, iterations: {cells[0]}"
    if pose is None:
        table.add(title, triangles, *cells, ms, LEFT, "", "")
        return label, None
    far = np.abs(exact[0].distances(points_of(pose[1]))) * exact[1]
    table.add(
        title,
        triangles,
        *cells,
        ms,
        f"{value(pose[1], 'EdgeStretchMax'):.3g}",
        f"{roughness(pose[1]):.1f}",
        f"{far.mean():.1f} / {np.percentile(far, 95):.1f}",
    )
    return label, pose


def tables(case: Case) -> list[Table]:
    """Return time and quality of each resolution."""
    columns = ("mesh", "triangles", "iterations", "published [ms]", "ms of processor time (plain iterations)")
    columns += ("longest edge", "roughness [deg]", "distance, mean / p95 [mm]")
    table = Table(f"Fig. 9: {case.adductor} at 40 degrees", columns)
    flexion = 6.0 if case.short else FLEXION
    surfaces = meshes(case)
    reference = case.chain(case.adductor, PATHS).pose(flexion)
    assert reference is not None
    exact = solids_of(*checked_surface(reference[1], "test")), case.scene.millimetres
    runs = [("full", 100, 658.71), ("L1", 100, ""), ("L2", 100, ""), ("L2", 1000, 349.80), ("L2", 10000, "")]
    row = []
    for title, count, published in runs[:3] if case.short else runs:
        chain = case.chain(case.adductor, PRINTED, surface=surfaces[title], iterations=count)
        row.append(add(table, chain, flexion, exact, f"{title}, {PRINTED}", count, published))
    for title, surface in surfaces.items():
        chain = case.chain(case.adductor, STABLE, surface=surface, iterations=ITERATIONS)
        row.append(add(table, chain, flexion, exact, f"{title}, {STABLE}", ITERATIONS, ""))
    for title, surface in surfaces.items():
        chain = case.chain(case.adductor, PATHS, surface=surface)
        row.append(add(table, chain, flexion, exact, f"{title}, {PATHS}", "", ""))
    if case.draws:
        case.draw("kohout2021_fig9.png", seen_alike([row]))
    return [table, why(case, surfaces, flexion)]


if __name__ == "__main__":
    main(__doc__, tables)
