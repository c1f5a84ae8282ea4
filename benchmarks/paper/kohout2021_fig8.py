"""Kohout and Červenka 2021, Fig. 8: iterations, anisotropy, fixed points.

For each: the longest edge over its length at rest (a spike), the 95th percentile of the angles between
neighbouring triangles (how crumpled the surface is), and how far anisotropy moves the points.
"""

from __future__ import annotations

from typing import Any

from common import FINE, LEFT, PATHS, PRINTED, STABLE, Case, Table, main, rms, roughness, seen_alike, value

ITERATIONS = (1, 3, 5, 10, 100)
FLEXION = 40.0


def tables(case: Case) -> list[Table]:
    """Return how each looks, in numbers."""
    columns = (
        "fixed by",
        "iterations",
        "longest edge, off / on",
        "roughness, off / on [deg]",
        "rms off to on [mm]; published: barely observable",
    )
    table = Table(f"Fig. 8: anisotropy off and on, {case.adductor} at 40 degrees", columns)
    rest = roughness(case.scene.muscles[case.adductor].surface)
    table.add("at rest", "", "1.0", f"{rest:.1f}", "")
    counts = (1, 3) if case.short else ITERATIONS
    flexion = 4.0 if case.short else FLEXION
    rows = []
    for fixed in ("collision", "attachment"):
        kinds = []
        for anisotropy in ("off", "fibres"):
            fixing = {"method": fixed, "n_voxels": FINE}
            poses = [
                pose_of(case, PRINTED, flexion, fixing=fixing, iterations=count, anisotropy=anisotropy)
                for count in counts
            ]
            kinds.append(poses)
            rows.append(
                [(f"{fixed}, anisotropy {anisotropy}, {n}", p) for n, p in zip(counts, poses, strict=True)]
            )
        for count, off, on in zip(counts, *kinds, strict=True):
            edges = " / ".join(longest_edge(pose) for pose in (off, on))
            rough = " / ".join(LEFT if pose is None else f"{roughness(pose[1]):.1f}" for pose in (off, on))
            apart = "" if off is None or on is None else f"{rms(off[1], on[1]) * case.scene.millimetres:.3g}"
            table.add(fixed, count, edges, rough, apart)
    ours = [(STABLE, str(n), pose_of(case, STABLE, flexion, iterations=n)) for n in counts]
    ours.append((PATHS, "", pose_of(case, PATHS, flexion)))
    for title, count, pose in ours:
        assert pose is not None
        table.add(f"attachment, {title}", count, longest_edge(pose), f"{roughness(pose[1]):.1f}", "")
    rows.append([(f"{title}, {count}", pose) for title, count, pose in ours[-len(counts) :]])
    if case.draws:
        case.draw("kohout2021_fig8.png", seen_alike(rows))
    return [table]


def pose_of(case: Case, model: str, flexion: float, **settings: Any) -> tuple[Any, Any] | None:
    """Return bones and muscle at a flexion by a model."""
    return case.chain(case.adductor, model, measure_shape=True, **settings).pose(flexion)


def longest_edge(pose: tuple[Any, Any] | None) -> str:
    """Return the longest edge over its length at rest, as text."""
    return LEFT if pose is None else f"{value(pose[1], 'EdgeStretchMax'):.3g}"


if __name__ == "__main__":
    main(__doc__, tables)
