"""Kohout and Červenka 2021, Figs. 4 and 5: which points are fixed.

A point that another method fixes further than 5 mm from the patches of the landmarks is counted as wrong: it
should slide along the bone.
"""

from __future__ import annotations

import numpy as np
from common import Case, Table, main, picture
from scipy.spatial import cKDTree

from vtkmuscle.data.arrays import multiblock_from, point_array, points_of
from vtkmuscle.filters import FixedPointDetector

#: How far from the attachment areas a fixed point is wrong [mm].
FAR = 5.0
PUBLISHED = {
    "collision": "fixes points that should slide",
    "proximity, mean edge": "hardly better than collision",
    "proximity, 0.5 mm": "iliacus: at least reasonable",
    "proximity, 1 mm": "perfect for gluteus maximus only",
    "attachment": "the best",
}


def tables(case: Case) -> list[Table]:
    """Return how many points each method fixes."""
    mm = case.scene.millimetres
    detectors = {
        "attachment": {"method": "attachment"},
        "collision": {"method": "collision", "n_voxels_per_axis": 64},
        "proximity, mean edge": {"method": "proximity"},
        "proximity, 0.5 mm": {"method": "proximity", "distance": 0.5 / mm},
        "proximity, 1 mm": {"method": "proximity", "distance": 1.0 / mm},
    }
    columns = ("muscle", "method", "published", "fixed points", f"of these > {FAR:g} mm from the areas")
    table = Table("Figs. 4 and 5: fixed points", columns)
    rows = []
    for name in ("gluteus_maximus", "iliacus"):
        row, patches = [], None
        for title, settings in detectors.items():
            fixed = FixedPointDetector(**settings).apply(
                case.scene.muscles[name].surface, case.scene.bones_data(), case.scene.attachments_data(name)
            )
            held = points_of(fixed)[point_array(fixed, "FixedTo", name) >= 0] * mm
            patches = cKDTree(held) if patches is None else patches
            wrong = int((patches.query(held)[0] > FAR).sum())
            table.add(
                name, title, PUBLISHED[title], f"{len(held)} of {len(np.asarray(points_of(fixed)))}", wrong
            )
            if case.draws:
                pixels = picture(multiblock_from({}), [fixed], fixed_points=True)
                row.append((f"{name}: {title}\n{len(held)} points", pixels))
        rows.append(row)
    if case.draws:
        case.draw("kohout2021_fig4_5.png", rows)
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
