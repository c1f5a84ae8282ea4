"""Kohout and Červenka 2021, Fig. 6: muscles decomposed into 100 fibres of 15 segments, and the time of it.

Fibres as the paper took them (Kohout and Kukačka 2014), and our defaults. Times are processor time, all
threads together: the first decomposition of a surface, and the least of three more, which find what was
prepared of the surface. Outside is more than 0.1 mm.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from common import Case, Table, main, picture
from kohout2012_time import decompose_once

from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import checked_surface, multiblock_from, polylines_of

KINDS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("as published (Kohout and Kukačka 2014)", {"published": "kohout2014"}),
    ("defaults", {}),
)
TOLERANCE, RESOLUTION, ROUNDS = 0.1, 15, 3


def tables(case: Case) -> list[Table]:
    """Return the times, and how many points of the fibres leave the muscle."""
    columns = (
        "muscle",
        "triangles",
        "published [ms]",
        "fibres",
        "first [ms]",
        "again [ms]",
        "points outside",
    )
    table = Table("Fig. 6: decomposition into 100 fibres of 15 segments", columns)
    decompose_once(case, case.muscles[-1], case.scene.muscles[case.muscles[-1]].surface)  # compiles
    row = []
    for name in case.muscles:
        for title, settings in KINDS:
            fresh = pv.wrap(case.scene.muscles[name].surface).copy()
            fresh.points = fresh.points + 0.0  # nothing is remembered of it
            first, fibres = decompose_once(case, name, fresh, RESOLUTION, **settings)
            again = min(decompose_once(case, name, fresh, RESOLUTION, **settings)[0] for _ in range(ROUNDS))
            points = polylines_of(fibres, name).points
            distance = solids_of(*checked_surface(fresh, "test"))
            far = np.where(distance.depth(points) > 0.0, 0.0, np.abs(distance.distances(points)))
            outside = int((far * case.scene.millimetres > TOLERANCE).sum())
            published = "< 50" if case.real else ""
            cells = (f"{first:.0f}", f"{again:.0f}", f"{outside} of {len(points)}")
            table.add(name, fresh.n_cells, published, title, *cells)
            if case.draws:
                row.append((f"{name}, {title}", picture(multiblock_from({}), [fresh], fibres=fibres)))
    if case.draws:
        case.draw("kohout2021_fig6.png", [row])
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
