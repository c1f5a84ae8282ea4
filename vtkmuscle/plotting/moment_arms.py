"""Figures of moment arms: the band of the paths, the mean, a quartic, and what is published."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.types import Floats
from vtkmuscle.io.literature import LOWER, UPPER, LiteratureCurve, curves_for
from vtkmuscle.plotting.colours import MUSCLE_RED, PALETTE
from vtkmuscle.plotting.sheets import DOTS_PER_INCH


def plot_moment_arms(
    arms: Mapping[str, JointArms],
    *,
    errors: Mapping[str, Floats] | None = None,
    literature: Sequence[LiteratureCurve] = (),
    title: str = "",
) -> Figure:
    """Return a figure of the moment arms of a muscle by each coordinate, side by side.

    Parameters
    ----------
    arms : mapping of str to JointArms
        Per coordinate, at least one.
    errors : mapping of str to (m,) array, optional
        Per coordinate what is known of the error of the mean in all, with 95 % confidence, as
        ``result.errors[NAME]["moment_arm_COORDINATE"].total``.
    literature : sequence of LiteratureCurve, optional
        Published ones of the muscle; those of a coordinate of this name are drawn.
    title : str, optional
        Above the panels.

    Returns
    -------
    matplotlib.figure.Figure
        To be saved by ``savefig``.
    """
    figure = Figure(figsize=(9.0 * len(arms), 4.8), dpi=DOTS_PER_INCH, facecolor="white")
    FigureCanvasAgg(figure)
    if title:
        figure.suptitle(title)
    for number, (name, found) in enumerate(arms.items()):
        axes = figure.add_axes((number / len(arms), 0.12, 1.0 / len(arms), 0.79))
        _draw(axes, found, None if errors is None else errors.get(name))
        unit = ANGLES.get(found.unit)
        if unit is not None:
            _draw_literature(axes, curves_for(literature, coordinate=name), math.pi / 180.0 / unit)
        axes.axhline(0.0, color="0.7", linewidth=0.8, zorder=0)
        axes.spines[["top", "right"]].set_visible(False)
        axes.set_xlabel(f"{name.replace('_', ' ')} [{found.unit}], positive: {found.positive or 'upwards'}")
        axes.set_ylabel("moment arm [mm]" if unit is not None else "moment arm [1]")
        legend = axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        # The legend stands beside the curves, and they have what it leaves of the panel.
        width = legend.get_window_extent().width / figure.bbox.width * len(arms)
        place = axes.get_position()
        place.x0, place.x1 = place.x0 + 0.08 * place.width, place.x1 - min(width + 0.01, 0.6) * place.width
        axes.set_position(place)
    return figure


def _draw(axes: Axes, found: JointArms, errors: Floats | None) -> None:
    # A sweep up and down has values twice: curves are drawn by ascending value.
    order = np.argsort(found.values, kind="stable")
    values, mean = found.values[order], found.mean[order]
    low, high = found.arms.min(axis=1)[order], found.arms.max(axis=1)[order]
    paths = found.arms.shape[1]
    axes.fill_between(values, low, high, color=MUSCLE_RED, alpha=0.18, linewidth=0, label=f"{paths} paths")
    if errors is not None:
        axes.fill_between(
            values,
            mean - errors[order],
            mean + errors[order],
            color="black",
            alpha=0.3,
            linewidth=0,
            label="error of the mean (95 %)",
        )
    axes.plot(values, mean, color="black", linewidth=2.0, label="mean")
    if found.quartic is not None:
        quartic = found.quartic.mean(axis=1)[order]
        axes.plot(values, quartic, color="black", linewidth=1.2, linestyle="--", label="mean of quartic fits")


def _draw_literature(axes: Axes, curves: Sequence[LiteratureCurve], per_degree: float) -> None:
    """Draw published curves: bands where a source has two sides, markers where it has single values."""
    colours = itertools.cycle([colour for colour in PALETTE if colour != MUSCLE_RED])
    of_source = {source: next(colours) for source in dict.fromkeys(curve.source for curve in curves)}
    uppers = {_sides(curve): curve for curve in curves if curve.part.endswith(UPPER)}
    lowers = {_sides(curve) for curve in curves if curve.part.endswith(LOWER)}
    for curve in curves:
        colour, angles = of_source[curve.source], curve.angles * per_degree
        other = uppers.get(_sides(curve))
        if curve.part.endswith(LOWER) and other is not None:
            first, last = max(curve.angles[0], other.angles[0]), min(curve.angles[-1], other.angles[-1])
            grid = np.linspace(first, last, 200)
            low, high = (np.interp(grid, side.angles, side.arms) for side in (curve, other))
            axes.fill_between(
                grid * per_degree,
                low,
                high,
                color=colour,
                alpha=0.2,
                linewidth=0,
                label=f"{curve.source}, fibres",
            )
            continue
        if curve.part.endswith(UPPER) and _sides(curve) in lowers:
            continue  # drawn with the other side
        label = ", ".join(word.replace("_", " ") for word in (curve.source, curve.part) if word)
        single = len(angles) == 1
        axes.plot(
            angles,
            curve.arms,
            color=colour,
            linewidth=1.5,
            linestyle="" if single else "-",
            marker="D" if single else "",
            label=label,
        )


def _sides(curve: LiteratureCurve) -> tuple[str, str]:
    """Return what the two sides of a band have in common."""
    return curve.source, curve.part.removesuffix(LOWER).removesuffix(UPPER)
