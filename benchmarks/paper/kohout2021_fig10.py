"""Kohout and Červenka 2021, Fig. 10: the iliacus, 5 iterations, 40 degrees.

In the joint are points within the acetabulum, which is the convex hull of the socket (bench_penetration.py).
"""

from __future__ import annotations

from typing import Any

from common import FINE, LEFT, PATHS, PRINTED, STABLE, Case, Table, main, seen_alike, value

from vtkmuscle.data.arrays import points_of

FLEXION, ITERATIONS = 40.0, 5


def tables(case: Case) -> list[Table]:
    """Return how far each enters bones and joint."""
    off = {"bone_push": "off"}
    cases: dict[str, tuple[str, str, str, dict[str, Any]]] = {
        "fixed by collision": ("unacceptable", "collision", PRINTED, {}),
        "by attachment": ("slightly better", "attachment", PRINTED, {}),
        "by attachment, bone_push off": ("acceptable, small penetration", "attachment", PRINTED, off),
        "by collision, stable": ("", "collision", STABLE, {}),
        "by attachment, stable": ("", "attachment", STABLE, {}),
        "by attachment, default model": ("", "attachment", PATHS, {}),
    }
    columns = (
        "",
        "published",
        "longest edge",
        "deepest in bone [mm]",
        "points in bone",
        "points in the joint",
    )
    table = Table("Fig. 10: iliacus at 40 degrees", columns)
    joint = None
    if case.real:
        from bench_penetration import Acetabulum

        joint = Acetabulum(case.scene)
    row = []
    for title, (published, fixed, model, settings) in cases.items():
        fixing = {"method": fixed, "n_voxels": FINE} if fixed == "collision" else {"method": fixed}
        measures = {"measure_shape": True, "measure_penetration": True}
        chain = case.chain("iliacus", model, fixing=fixing, **measures, **settings)
        if model != PATHS:
            chain.deformer.iterations = ITERATIONS
        pose = chain.pose(6.0 if case.short else FLEXION)
        row.append((title, pose))
        if pose is None:
            table.add(title, published, LEFT, "", "", "")
            continue
        muscle = pose[1]
        inside = "" if joint is None else int((joint.depth(points_of(muscle)) > 0.0).sum())
        table.add(
            title,
            published,
            f"{value(muscle, 'EdgeStretchMax'):.3g}",
            f"{value(muscle, 'PenetrationMax') * case.scene.millimetres:.2f}",
            int(value(muscle, "PenetratingPoints")),
            inside,
        )
    if case.draws:
        case.draw("kohout2021_fig10.png", seen_alike([row]))
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
