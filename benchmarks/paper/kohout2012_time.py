"""Kohout et al. 2012: the time to fill a muscle with fibres and show them.

Published: about 1000 ms for a muscle of about 15 000 vertices, 20 points per fibre. Here 100 fibres of 19
segments, tubes of 12 sides, and a picture of 800 x 650 pixels off-screen, drawn by software. Times are
processor time, all threads together.
"""

from __future__ import annotations

import time
import warnings
from itertools import product

import pyvista as pv
from common import Case, Table, main

from vtkmuscle.filters import FibreTubes
from vtkmuscle.pipelines import decompose
from vtkmuscle.plotting import can_render, choose_view, make_plotter

ROUNDS = 3
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
    decompose_once(case, case.muscles[-1])  # compiles
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


def decompose_once(case: Case, name: str, surface: object = None, **settings: str) -> tuple[float, object]:
    """Return the time of a decomposition with new filters [ms], and its fibres."""
    surface = case.scene.muscles[name].surface if surface is None else surface
    begin = time.process_time()
    chain = decompose(surface, case.scene.attachments_data(name), n_fibres=100, resolution=19, **settings)
    with warnings.catch_warnings():  # mean value maps warn of points outside
        warnings.simplefilter("ignore")
        fibres = chain.update().output
    return 1e3 * (time.process_time() - begin), fibres


if __name__ == "__main__":
    main(__doc__, tables)
