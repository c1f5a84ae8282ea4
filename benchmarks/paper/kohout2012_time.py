"""Kohout et al. 2012: the time to fill a muscle with fibres and show them.

Published: about 1000 ms for a muscle of about 15 000 vertices, 20 points per fibre. Here 100 fibres of 19
segments, tubes of 12 sides, and a picture of 800 x 650 pixels off-screen, drawn by software. Times are
processor time, all threads together.
"""

from __future__ import annotations

import time
import warnings
from itertools import product
from typing import Any

import pyvista as pv
from common import Case, Table, main

from vtkmuscle.filters import FibreTubes
from vtkmuscle.pipelines import decompose
from vtkmuscle.plotting import can_render, choose_view, make_plotter

RESOLUTION, ROUNDS = 19, 3
KINDS: tuple[tuple[str, dict[str, str]], ...] = (
    ("as published", {"published": "kohout2012"}),
    ("defaults", {}),
)


def tables(case: Case) -> list[Table]:
    """Return the times of decomposition, tubes and picture."""
    columns = ("muscle", "vertices", "fibres", "published [ms]", "first run: fibres [ms]", "again [ms]")
    columns += ("tubes [ms]",)
    table = Table(
        "Decomposition and picture of a muscle", (*columns, "picture [ms]", "sum of the first [ms]")
    )
    decompose_once(case, case.muscles[-1], case.scene.muscles[case.muscles[-1]].surface)  # compiles
    draws = can_render() is None
    for name, (title, settings) in product(case.muscles, KINDS):
        muscle = case.scene.muscles[name].surface
        fresh = pv.wrap(muscle).copy()
        fresh.points = fresh.points + 0.0  # nothing is remembered of it
        first, fibres = decompose_once(case, name, fresh, **settings)
        again = min(decompose_once(case, name, fresh, **settings)[0] for _ in range(ROUNDS))
        begin = time.process_time()
        FibreTubes(radius=1.0 / case.scene.millimetres)(fibres)
        tubes = 1e3 * (time.process_time() - begin)
        drawn = 0.0
        if draws:
            bones = case.scene.bones_data()
            view = choose_view([muscle], [bones])
            begin = time.process_time()
            plotter = make_plotter(bones, [muscle], view, fibres=fibres)
            plotter.screenshot(return_img=True)
            plotter.close()
            drawn = 1e3 * (time.process_time() - begin)
        cells = [f"{ms:.0f}" for ms in (first, again, tubes)]
        table.add(
            name,
            muscle.GetNumberOfPoints(),
            title,
            "about 1000",
            *cells,
            f"{drawn:.0f}" if draws else "",
            f"{first + tubes + drawn:.0f}",
        )
    return [table]


def decompose_once(
    case: Case, name: str, surface: Any, resolution: int = RESOLUTION, **settings: Any
) -> tuple[float, Any]:
    """Return the time of a decomposition into 100 fibres with new filters [ms], and these."""
    attachments = case.scene.attachments_data(name)
    begin = time.process_time()
    chain = decompose(surface, attachments, n_fibres=100, resolution=resolution, **settings)
    with warnings.catch_warnings():  # mean value maps warn of points outside
        warnings.simplefilter("ignore")
        fibres = chain.update().output
    return 1e3 * (time.process_time() - begin), fibres


if __name__ == "__main__":
    main(__doc__, tables)
