"""P21, Fig. 7: how far points move between iterations. ``python benchmarks/paper/p21_fig7.py``.

The mean over the points of the adductor brevis, and over the frames of 90 degrees of flexion, of the distance
between two iterates of a step. The second table asks what of the method the figure hangs on, one change after
the other: whether a stiffness holds per step or per iteration; whether points are moved on by their velocity
once per step, as Algorithm 2 of the paper reads, or in each iteration, as in the code published with it
(github.com/cervenkam/muscle-deformation-PBD at 66cce66, ``src/pbd.cxx``: ``move_points_by_force`` and
``update_velocities`` are within the loop over iterations); and whether the local shape is kept at all (that
code leaves out corrections of dihedral angles that are small, or of one sign).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import numpy as np
from common import P21, STEP, Case, Floats, Table, angles_up_to, main, value

from vtkmuscle import RigidMotion
from vtkmuscle.core import solver
from vtkmuscle.filters.arrays import points_of
from vtkmuscle.pipelines import deform
from vtkmuscle.plotting.sheets import curves

SHOWN = (1, 2, 3, 5, 10, 25, 50, 99)
PUBLISHED = {5: "< 0.1 (in a few)", 10: "< 0.01"}


@contextmanager
def recorded(moves: list[float]) -> Iterator[None]:
    """Note the mean distance that points are moved by from the iterate before, iteration by iteration."""

    def noting(original: Any) -> Any:
        def iterate(self: Any, p: Any, *arguments: Any, **keywords: Any) -> Any:
            before = p.copy()
            result = original(self, p, *arguments, **keywords)
            moves.append(float(np.linalg.norm(p - before, axis=1).mean()))
            return result

        return iterate

    orders = (solver.SequentialOrder, solver.ColourOrder)
    with (
        mock.patch.object(orders[0], "iterate", noting(orders[0].iterate)),
        mock.patch.object(orders[1], "iterate", noting(orders[1].iterate)),
    ):
        yield


def stiffness_per_iteration() -> Any:
    """Let stiffnesses hold per iteration, as Algorithm 2 reads; here they hold per step."""
    return mock.patch.object(solver, "per_iteration_stiffness", lambda stiffness, _: np.asarray(stiffness))


def once_per_step(case: Case, iterations: int, settings: dict[str, Any]) -> tuple[Floats, float]:
    """Return the displacement per iteration [mm], mean of the frames, and the longest edge at their end."""
    chain = case.chain(case.adductor, iterations=iterations, **settings)
    frames = []
    for angle in flexions(case):
        moves: list[float] = []
        with recorded(moves):
            muscle = chain.at(angle)
        frames.append(moves[-iterations:])
    return np.mean(frames, axis=0) * case.scene.millimetres, value(muscle, "EdgeStretchMax")


def in_each_iteration(case: Case, iterations: int, settings: dict[str, Any]) -> tuple[Floats, float]:
    """Return the same where velocities are of iterations: steps of one, the bones still after the first."""
    chain = case.chain(case.adductor)
    angles = flexions(case)
    frames = [0, *(round(angle / STEP) for angle in angles for _ in range(iterations))]
    motion = RigidMotion(
        np.arange(float(len(frames))),
        {bone: np.asarray(poses)[frames] for bone, poses in case.motion.transforms.items()},
    )
    deformer = deform(
        chain.marked,
        case.scene.bones_data(),
        motion,
        fibres=chain.fibres,
        fixed=None,
        **{**settings, "iterations": 1},
    )
    before, moves = points_of(deformer.update(time=0.0).output).copy(), []
    for time in motion.times[1:]:
        muscle = deformer.update(time=float(time)).output
        now = points_of(muscle).copy()
        moves.append(float(np.linalg.norm(now - before, axis=1).mean()))
        before = now
    by_frame = np.reshape(moves, (len(angles), iterations))
    return by_frame.mean(axis=0) * case.scene.millimetres, value(muscle, "EdgeStretchMax")


def flexions(case: Case) -> list[float]:
    """Return the flexions of the steps."""
    return angles_up_to(4.0 if case.short else 90.0)[1:]


def causes(case: Case, count: int) -> dict[str, tuple[Floats, float]]:
    """Return the displacements with P21's settings, changed one after the other towards its code."""
    found = {"Algorithm 2, stiffness per step": once_per_step(case, count, P21)}
    with stiffness_per_iteration():
        found["stiffness per iteration"] = once_per_step(case, count, P21)
        flat = {**P21, "shape_stiffness": 0.0}
        found["the same, no local shape"] = once_per_step(case, count, flat)
    found["velocity in each iteration"] = in_each_iteration(case, count, P21)
    found["the same, no local shape (their code is between the two)"] = in_each_iteration(case, count, flat)
    return found


def tables(case: Case) -> list[Table]:
    """Return the displacement after so many iterations."""
    count = 12 if case.short else 100
    found = causes(case, count)
    main_columns = {"P21's settings": next(iter(found.values()))[0]}
    main_columns["defaults"] = once_per_step(case, count, {})[0]
    columns = ("iteration", "published [mm]", *(f"{title} [mm]" for title in main_columns))
    table = Table(f"Fig. 7: mean displacement between iterations, {case.adductor}", columns)
    shown = [number for number in SHOWN if number < count]
    for number in shown:
        moves = (f"{column[number]:.4f}" for column in main_columns.values())
        table.add(number, PUBLISHED.get(number, ""), *moves)
    columns = ("P21's settings, changed", *(f"{number} [mm]" for number in shown), "longest edge at the end")
    why = Table("What Fig. 7 hangs on: the same displacement, by iteration", columns)
    why.add("published", *(PUBLISHED.get(number, "") for number in shown), "")
    for title, (moves, edge) in found.items():
        why.add(title, *(f"{moves[number]:.3f}" for number in shown), f"{edge:.0f}")
    if case.out is not None:
        figure, axes = curves("P21, Fig. 7", "iteration", "mean displacement [mm]")
        drawn = {title: moves for title, (moves, _) in found.items()}
        for title, moves in {**drawn, "defaults": main_columns["defaults"]}.items():
            axes.semilogy(np.arange(1, len(moves) + 1), moves, label=title)
        axes.axhline(0.1, color="grey", lw=0.8)
        axes.axhline(0.01, color="grey", lw=0.8)
        axes.legend()
        case.save(figure, "p21_fig7.png")
    return [table, why]


if __name__ == "__main__":
    main(__doc__, tables)
