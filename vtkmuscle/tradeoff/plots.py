"""Plots of a study: each error against the time, with the front of what no other setting beats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.io.writing import replacing
from vtkmuscle.tradeoff.measures import ERRORS, Measure
from vtkmuscle.tradeoff.study import Study

FORMATS = ("png", "svg")

#: Errors below these are drawn at it: what is left of them is rounding.
_LEAST = {"volume_error_pct": 1e-4, "penetration_p95_mm": 1e-3, "penetration_max_mm": 1e-3}
_LEAST_ERROR = 1e-3
#: Errors that are ratios or angles of about the same size for all settings: no logarithm.
_LINEAR = ("edge_stretch_p95", "edge_stretch_max", "dihedral_p95_deg")
_MARKERS = "osv^<>DpXhP*d"


def front(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Return the numbers of the points that none is below in cost and error both, by ascending cost.

    Examples
    --------
    >>> from vtkmuscle.tradeoff.plots import front
    >>> front([1.0, 2.0, 3.0, 2.5], [5.0, 1.0, 1.0, 0.5])
    [0, 1, 3]
    """
    best, least = [], np.inf
    for number in np.lexsort((errors, costs)):
        if errors[number] < least:
            best.append(int(number))
            least = errors[number]
    return best


def write_plots(out: Path, study: Study) -> list[Path]:
    """Write a plot per error; return their paths."""
    import matplotlib as mpl  # noqa: PLC0415 -- slow to import, and only plots need it
    from matplotlib.figure import Figure  # noqa: PLC0415

    paths = []
    # Text stays text and ids stay the same, so that a plot is small and changes with its data alone.
    with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": "vtkmuscle", "font.size": 9}):
        for measure in ERRORS:
            figure = Figure(figsize=(7.0, 4.4), layout="constrained")
            if _draw_front(figure, study, measure):
                paths += _save(figure, out / f"pareto_{measure.name}")
    return paths


def _save(figure: Any, path: Path) -> list[Path]:
    paths = [path.with_suffix(f".{kind}") for kind in FORMATS]
    for file, kind in zip(paths, FORMATS, strict=True):
        with replacing(file) as beside:
            metadata = {"Date": None} if kind == "svg" else {}
            figure.savefig(beside, format=kind, dpi=120, metadata=metadata)
    return paths


def _draw_front(figure: Any, study: Study, measure: Measure) -> bool:
    """Draw an error against the time; return whether there is anything to draw."""
    rows = [
        r for r in study.rows if r.figures["all"][measure.name] is not None and r.setting.group != "reference"
    ]
    if not rows:
        return False
    axes = figure.add_subplot()
    least = _LEAST.get(measure.name, _LEAST_ERROR)
    costs = [row.figures["all"]["ms_per_frame"] for row in rows]
    errors = [max(row.figures["all"][measure.name], least) for row in rows]
    best = front(costs, errors)
    axes.plot(
        np.take(costs, best), np.take(errors, best), "-", color="0.75", linewidth=5, zorder=0, label="front"
    )
    groups = list(dict.fromkeys(row.setting.group for row in rows if row.setting.group != "presets"))
    for number, group in enumerate(groups):
        own = [i for i, row in enumerate(rows) if row.setting.group == group]
        style = {"color": f"C{number % 10}", "marker": _MARKERS[number % len(_MARKERS)]}
        axes.plot(
            np.take(costs, own), np.take(errors, own), markersize=4, linewidth=0.8, label=group, **style
        )
    for i, row in enumerate(rows):
        if row.setting.group == "presets":
            axes.plot(costs[i], errors[i], "*", color="black", markersize=13, zorder=5)
            axes.annotate(
                row.setting.name,
                (costs[i], errors[i]),
                xytext=(7, 5),
                textcoords="offset points",
                weight="bold",
            )
    axes.set_xscale("log")
    if measure.name not in _LINEAR:
        axes.set_yscale("log")
    axes.set_xlabel("processor time per step, all muscles [ms]")
    axes.set_ylabel(measure.words, wrap=True)
    axes.set_title(f"{study.scene}: {len(study.muscles)} muscles", fontsize=10)
    axes.grid(alpha=0.3, which="major")
    figure.legend(loc="outside right upper", fontsize=7, frameon=False)
    return True
