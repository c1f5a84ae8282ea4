"""Kohout and Červenka 2021, Tables 1 and 2: time of a step against iterations, and of four muscles.

A step is one update of the deformer with its bones, over 2 degrees, without fibres that are carried; see
``Chain.step_time``. In brackets are plain iterations: the time over that of an iteration of plain scalar
kernels on the same mesh, in turns with it, which leaves the speed of the machine out. The authors' published
code (C++, -O3, one core) was measured on a machine like ours when nothing else ran, where such an iteration
took 1.7 ms. The published times are of an i7-7700K.
"""

from __future__ import annotations

import numpy as np
from common import MODELS, PATHS, PRINTED, STABLE, Case, Table, angles_up_to, main

PUBLISHED = {1: 53.04, 3: 62.55, 5: 74.66, 10: 104.96, 25: 193.66, 50: 441.72, 100: 658.71}
CODE = {1: 6.9, 3: 18.0, 5: 28.6, 10: 57.3, 25: 137.0, 50: 275.0, 100: 544.0}
#: Of a plain iteration where the published code was measured [ms].
PLAIN = 1.7
FRAMES = {"gluteus_maximus": 33.85, "adductor_brevis": 35.89, "iliacus": 47.21, "gluteus_medius": 57.12}


def cell(shown: float, plain: float) -> str:
    """Return a time or a rate, and the time in plain iterations where these are known."""
    return f"{shown:.3g}" + (f" ({float(f'{plain:.2g}'):g})" if np.isfinite(plain) else "")


def by_iterations(case: Case) -> Table:
    """Return the times of a step against iterations."""
    columns = ("iterations", "published", "their code (plain iterations)", *MODELS)
    table = Table(f"Table 1: ms of processor time per step, {case.adductor}", columns)
    angles = angles_up_to(6.0 if case.short else 24.0)
    paths = case.chain(case.adductor, PATHS).step_time(angles)
    for count in (1, 3) if case.short else PUBLISHED:
        pbd = [
            case.chain(case.adductor, model, iterations=count).step_time(angles)
            for model in (PRINTED, STABLE)
        ]
        theirs = cell(CODE[count], CODE[count] / PLAIN) if case.real else ""
        table.add(count, PUBLISHED[count], theirs, *(cell(*times) for times in (*pbd, paths)))
    return table


def by_muscle(case: Case) -> Table:
    """Return frames per second of the muscles, 3 iterations and 64^3 voxels."""
    columns = ("muscle", "triangles", "published", "their code (plain iterations)", *MODELS)
    table = Table("Table 2: frames per second of processor time, 3 iterations", columns)
    angles = angles_up_to(6.0 if case.short else 90.0)
    for name in case.muscles:
        times = []
        for model, chain in case.chains(name, 3).items():
            if model == PRINTED:
                chain.deformer.n_voxels_per_axis = 64
            times.append(chain.step_time(angles))
        theirs = cell(1e3 / CODE[3], CODE[3] / PLAIN) if case.real and name == "adductor_brevis" else ""
        published = FRAMES[name] if case.real else ""
        triangles = case.scene.muscles[name].surface.GetNumberOfCells()
        table.add(name, triangles, published, theirs, *(cell(1e3 / step, plain) for step, plain in times))
    return table


def tables(case: Case) -> list[Table]:
    """Return both."""
    return [by_iterations(case), by_muscle(case)]


if __name__ == "__main__":
    main(__doc__, tables)
