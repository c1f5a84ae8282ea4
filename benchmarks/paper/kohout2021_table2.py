"""Kohout and Červenka 2021, Table 2: frames per second, 3 iterations, 64^3 voxels.

A frame is all of Algorithm 2, as in kohout2021_table1.py. The defaults keep their own way to treat bones.
"""

from __future__ import annotations

import numpy as np
from common import AS_PUBLISHED, Case, Table, angles_up_to, main
from scipy.stats import spearmanr

#: Of the authors' code (C++, -O3, one core) on a machine like the one that ours were measured on: 18.0 ms.
THEIR_CODE = {"adductor_brevis": "56"}
PUBLISHED = {"gluteus_maximus": 33.85, "adductor_brevis": 35.89, "iliacus": 47.21, "gluteus_medius": 57.12}


def tables(case: Case) -> list[Table]:
    """Return the frames per second, with the published settings and the defaults."""
    columns = (
        "muscle",
        "triangles",
        "published",
        "their code",
        "as published, here",
        "defaults, 3 iterations",
        "defaults",
    )
    table = Table("Table 2: frames per second of processor time", columns)
    settings = (
        {**AS_PUBLISHED, "iterations": 3, "n_voxels_per_axis": 64},
        {"iterations": 3},
        {},
    )
    angles = angles_up_to(6.0 if case.short else 90.0)
    sizes, rates = [], []
    for name in case.muscles:
        sizes.append(case.scene.muscles[name].surface.GetNumberOfCells())
        rates.append([1e3 / np.median(case.chain(name, **s).step_times(angles)) for s in settings])
        theirs = (PUBLISHED[name], THEIR_CODE.get(name, "")) if case.real else ("", "")
        table.add(name, sizes[-1], *theirs, *(f"{r:.0f}" for r in rates[-1]))
    if len(set(sizes)) > 2:
        ranks = [spearmanr(sizes, column).statistic for column in np.transpose(rates)]
        table.add("Spearman's rho with triangles", "", "-1", "", *(f"{rho:.1f}" for rho in ranks))
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
