"""P21, Fig. 7: how far points move between iterations. ``python benchmarks/paper/p21_fig7.py``.

The mean over the points of the adductor brevis, and over the frames of 90 degrees of flexion, of the distance
between two iterates of a step.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from common import P21, Case, Table, angles_up_to, main

from vtkmuscle.core import solver
from vtkmuscle.plotting.sheets import curves

SHOWN = (1, 2, 3, 5, 10, 25, 50, 99)


@contextmanager
def recorded(moves: list[float]) -> Iterator[None]:
    """Note the mean distance that points are moved by from the iterate before, iteration by iteration."""
    orders = (solver.SequentialOrder, solver.ColourOrder)
    originals = [order.iterate for order in orders]

    def noting(original: Any) -> Any:
        def iterate(self: Any, p: Any, *arguments: Any, **keywords: Any) -> Any:
            before = p.copy()
            result = original(self, p, *arguments, **keywords)
            moves.append(float(np.linalg.norm(p - before, axis=1).mean()))
            return result

        return iterate

    for order, original in zip(orders, originals, strict=True):
        order.iterate = noting(original)
    try:
        yield
    finally:
        for order, original in zip(orders, originals, strict=True):
            order.iterate = original


def trace(case: Case, iterations: int, settings: dict[str, Any]) -> Any:
    """Return the mean displacement per iteration [mm], over the frames."""
    chain = case.chain(case.adductor, iterations=iterations, **settings)
    frames = []
    for angle in angles_up_to(4.0 if case.short else 90.0)[1:]:
        moves: list[float] = []
        with recorded(moves):
            chain.at(angle)
        frames.append(moves[-iterations:])
    return np.mean(frames, axis=0) * case.scene.millimetres


def tables(case: Case) -> list[Table]:
    """Return the displacement after so many iterations."""
    count = 12 if case.short else 100
    found = {"P21's settings": trace(case, count, P21), "defaults": trace(case, count, {})}
    columns = ("iteration", "published [mm]", *(f"{title} [mm]" for title in found))
    table = Table(f"Fig. 7: mean displacement between iterations, {case.adductor}", columns)
    published = {5: "< 0.1 (in a few)", 10: "< 0.01"}
    for number in SHOWN:
        if number < count:
            table.add(number, published.get(number, ""), *(f"{found[t][number]:.4f}" for t in found))
    if case.out is not None:
        figure, axes = curves("P21, Fig. 7", "iteration", "mean displacement [mm]")
        for title, moves in found.items():
            axes.semilogy(np.arange(1, len(moves) + 1), moves, label=title)
        axes.axhline(0.1, color="grey", lw=0.8)
        axes.axhline(0.01, color="grey", lw=0.8)
        axes.legend()
        case.save(figure, "p21_fig7.png")
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
