"""Kohout and Červenka 2021, Fig. 7: how far points move between iterations.

The mean over the points of the adductor brevis, and over the frames of 90 degrees of flexion, of the
distance between two iterates of a step: with Algorithm 2 as printed, without bones as in the paper's figure
and with them; with as many iterations per step as are shown and with 10; without anisotropy; and with the
loop of the code published with the paper (``published_loop.py``), which moves points on by their velocity in
each iteration.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from unittest import mock

import numpy as np
from common import PRINTED, STEP, Case, Floats, Table, angles_up_to, curves, main, value
from published_loop import run

from vtkmuscle.core.mesh.surface import edge_lengths, mesh_topology
from vtkmuscle.core.pbd import sweep
from vtkmuscle.core.pbd.sweep import edge_stiffness, fibre_directions_at
from vtkmuscle.data.arrays import checked_surface, point_array, points_of, polylines_of

#: Iterations, counted from 0: the tenth is 9.
SHOWN = (0, 1, 2, 4, 9, 24, 49, 99)
PUBLISHED = {4: "< 0.1 (in a few)", 9: "< 0.01"}


@contextmanager
def recorded(moves: list[float], end: Callable[[], Floats]) -> Iterator[None]:
    """Note the mean distance that points are moved by from the iterate before, iteration by iteration.

    An iteration begins with its distances: with where the one before ended. ``end`` gives where the last did.
    """
    before: list[Floats] = []
    project = sweep.project_edges

    def noting(p: Floats, points: Any, constants: Floats, with_lengths: bool, *arguments: Any) -> None:
        if with_lengths:
            if before:
                moves.append(float(np.linalg.norm(p[:-1] - before[-1], axis=1).mean()))
            before[:] = [p[:-1].copy()]
        project(p, points, constants, with_lengths, *arguments)

    with mock.patch.object(sweep, "project_edges", noting):
        yield
    moves.append(float(np.linalg.norm(end() - before[-1], axis=1).mean()))


@dataclass(frozen=True, eq=False)
class Trace:
    """What a way to iterate does.

    Attributes
    ----------
    moves : (frames, iterations) array
        Mean displacement of the points [mm], of the frames that were reached.
    longest : float or None
        Longest edge over its length at rest, at the end; None if the muscle left the range of numbers.
    """

    moves: Floats
    longest: float | None

    def at(self, number: int) -> str:
        """Return the mean over the frames after so many iterations, as text."""
        if not len(self.moves) or number >= self.moves.shape[1]:
            return ""
        mean = float(self.moves[:, number].mean())
        return f"{mean:.4f}" if mean < 100.0 else f"{mean:.0e}"

    @property
    def end(self) -> str:
        """How it ended, as text."""
        if self.longest is None:
            return f"leaves the range of numbers in the step to {STEP * (len(self.moves) + 1):g} degrees"
        return f"{self.longest:.1f}"


def once_per_step(case: Case, iterations: int, settings: dict[str, Any]) -> Trace:
    """Trace the deformer's own steps."""
    chain = case.chain(case.adductor, PRINTED, iterations=iterations, measure_shape=True, **settings)
    frames, longest = [], None
    for angle in flexions(case):
        moves: list[float] = []
        try:
            with recorded(
                moves, lambda: points_of(chain.deformer.output) - chain.deformer._kept["solver"][1][0].centre
            ):
                muscle = chain.at(angle)
        except ValueError:  # the muscle left the range of numbers: that is what is looked for
            longest = None
            break
        frames.append(moves[-iterations:])
        longest = value(muscle, "EdgeStretchMax")
    return Trace(np.array(frames) * case.scene.millimetres, longest)


def published_code(case: Case, iterations: int) -> tuple[Trace, float]:
    """Trace the loop of the published code; return also the share of dihedral angles that it corrects."""
    chain = case.chain(case.adductor, PRINTED)
    points, triangles = checked_surface(chain.fixed, case.adductor)
    edges = mesh_topology(len(points), triangles).edges
    lines = polylines_of(chain.fibres, case.adductor)
    directions = fibre_directions_at(points[edges].mean(axis=1), lines.points, lines.offsets)
    angles = flexions(case)
    poses = []
    for angle in angles:
        now = case.motion.at(float(case.motion.times[round(angle / STEP)]))
        poses.append([now.get(bone, np.eye(4)) for bone in case.scene.bones])
    fixed_to = point_array(chain.fixed, "FixedTo", case.adductor)
    stiffness = edge_stiffness(points, edges, directions)
    moves, share, end = run(points, triangles, np.asarray(fixed_to), stiffness, np.array(poses), iterations)
    longest = float((edge_lengths(end, edges) / edge_lengths(points, edges)).max())
    return Trace(moves * case.scene.millimetres, longest), share


def flexions(case: Case) -> list[float]:
    """Return the flexions of the steps."""
    return angles_up_to(4.0 if case.short else 90.0)[1:]


def tables(case: Case) -> list[Table]:
    """Return the displacement after so many iterations."""
    count = 12 if case.short else 100
    free = {"collision": "off"}
    found = {
        "as printed, no bones": once_per_step(case, count, free),
        "the same, 10 per step": once_per_step(case, min(10, count), free),
        "the same, isotropic": once_per_step(case, min(10, count), {**free, "anisotropy": "off"}),
        "as printed, with bones": once_per_step(case, count, {}),
    }
    code, share = published_code(case, count)
    found[f"the published code's loop: corrects {share:.1%} of the angles"] = code
    shown = [number for number in SHOWN if number < count]
    columns = ("settings", *(f"{number + 1} [mm]" for number in shown), "longest edge at the end")
    table = Table(f"Fig. 7: mean displacement after so many iterations, {case.adductor}", columns)
    table.add("published", *(PUBLISHED.get(number, "") for number in shown), "")
    for title, trace in found.items():
        table.add(title, *(trace.at(number) for number in shown), trace.end)
    if case.out is not None:
        figure, axes = curves("Kohout 2021, Fig. 7", "iteration", "mean displacement [mm]")
        for title, trace in found.items():
            if not len(trace.moves):
                continue
            moves = trace.moves.mean(axis=0)
            axes.semilogy(np.arange(1, len(moves) + 1), moves, label=title)
        for shown_by_the_paper in (0.1, 0.01):
            axes.axhline(shown_by_the_paper, color="grey", lw=0.8)
        axes.legend()
        case.save(figure, "kohout2021_fig7.png")
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
