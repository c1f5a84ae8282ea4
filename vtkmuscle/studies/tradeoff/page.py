"""The table, the plots and the page of a trade-off: errors against time, and what no setting beats."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from vtkmuscle.io.writing import replacing, write_text
from vtkmuscle.report.sections import Section, shown_rows, svg_of, write_page
from vtkmuscle.run.table import Table
from vtkmuscle.studies.tradeoff.measures import ERRORS, MEASURES, Measure
from vtkmuscle.studies.tradeoff.study import TradeOff

#: Digits of the numbers in the table.
_DIGITS = 6
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
    >>> from vtkmuscle.studies.tradeoff.page import front
    >>> front([1.0, 2.0, 3.0, 2.5], [5.0, 1.0, 1.0, 0.5])
    [0, 1, 3]
    """
    best, least = [], np.inf
    for number in np.lexsort((errors, costs)):
        if errors[number] < least:
            best.append(int(number))
            least = errors[number]
    return best


def write_trade_off(out: Path, found: TradeOff) -> list[Path]:
    """Write ``tradeoff.csv``, ``tradeoff.html`` and a plot per error (PNG and SVG); return their paths."""
    together = found.table.where(muscle="all")
    paths, drawings = [found.table.to_csv(out / "tradeoff.csv", digits=_DIGITS)], []
    for measure in ERRORS:
        figure = _front_of(together, measure, f"{found.scene}: {len(found.muscles)} muscles")
        if figure is not None:
            name = f"pareto_{measure.name}"
            with replacing(out / f"{name}.png") as beside:
                figure.savefig(beside, format="png", dpi=120)
            svg = svg_of(figure, "vtkmuscle")
            write_text(out / f"{name}.svg", svg)
            drawings.append((measure.words, svg))
            paths += [out / f"{name}.png", out / f"{name}.svg"]
    best = "The grey line is the front of what no other setting beats."
    columns = [("column", "what it is"), *((one.name, one.words) for one in MEASURES)]
    settled = [("muscle", "its reference"), *((one.muscle, str(one)) for one in found.doublings)]
    sections = [
        Section("All muscles", "A row per setting", [row[2:] for row in shown_rows(together)]),
        Section("Time against errors", best, drawings=drawings),
        Section("Reference", "Last doubling of its iterations", settled, words=True),
        Section("Columns", "What they are", columns, words=True),
    ]
    lead = f"{', '.join(found.muscles)}: distances to a converged run of the same model, and what they cost."
    return [*paths, write_page(out / "tradeoff.html", found.scene, "trade-off", lead, sections)]


def _front_of(table: Table, measure: Measure, title: str) -> Figure | None:
    """Return a drawing of an error against the time, None where there is nothing to draw."""
    known = ~np.isnan(table[measure.name].astype(np.float64)) & (table["group"] != "reference")
    if not known.any():
        return None
    figure = Figure(figsize=(7.0, 4.4), layout="constrained")
    axes = figure.add_subplot()
    costs, groups, names = (table[key][known] for key in ("ms_per_frame", "group", "setting"))
    errors = np.maximum(table[measure.name][known], _LEAST.get(measure.name, _LEAST_ERROR))
    best = front(costs, errors)
    axes.plot(costs[best], errors[best], "-", color="0.75", linewidth=5, zorder=0, label="front")
    for number, group in enumerate(name for name in dict.fromkeys(groups.tolist()) if name != "presets"):
        own = groups == group
        (line,) = axes.plot(costs[own], errors[own], linewidth=0.8, label=group, markersize=4)
        line.set(color=f"C{number % 10}", marker=_MARKERS[number % len(_MARKERS)])
    for i in np.flatnonzero(groups == "presets"):
        at = costs[i], errors[i]
        axes.plot(*at, "*", color="black", markersize=13, zorder=5)
        axes.annotate(names[i], at, xytext=(7, 5), textcoords="offset points", weight="bold")
    axes.set_xscale("log")
    if measure.name not in _LINEAR:
        axes.set_yscale("log")
    axes.set_xlabel("processor time per step, all muscles [ms]")
    axes.set_ylabel(measure.words, wrap=True)
    axes.set_title(title, fontsize=10)
    axes.grid(alpha=0.3, which="major")
    figure.legend(loc="outside right upper", fontsize=7, frameon=False)
    return figure
