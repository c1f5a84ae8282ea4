"""The page of a comparison, of the parts that the page of a run is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from markupsafe import Markup

from vtkmuscle.comparison.curves import Curve, difference
from vtkmuscle.io.literature import LiteratureCurve, side_apart
from vtkmuscle.report.curves import colour_of, label_of, published_curves, rounded
from vtkmuscle.report.page import part, plotly_text
from vtkmuscle.report.sections import Section, rendered, shown_rows
from vtkmuscle.report.tables import Sheet
from vtkmuscle.run.table import Table


def page_of(
    names: Sequence[str],
    curves: Mapping[str, Mapping[str, Mapping[str, Curve]]],
    literature: Mapping[str, Sequence[LiteratureCurve]],
    table: Table,
) -> str:
    """Return the page as text: curves over one another, differences to the first run, and the table."""
    colours = {name: colour_of(k) for k, name in enumerate(names)}
    charts = [
        _chart(f"chart-{i}-{j}", runs, colours, literature.get(muscle, ()))
        for i, (muscle, known) in enumerate(curves.items())
        for j, runs in enumerate(known.values())
    ]
    own = (files("vtkmuscle.comparison") / "page" / "comparison.js").read_text(encoding="utf-8")
    return rendered(
        "comparison.html",
        ("vtkmuscle.comparison", "page"),
        names=names,
        colours=colours,
        script=Markup("\n").join(
            [part("arrays.js"), part("colours.js"), part("curves.js"), part("saving.js"), Markup(own)]
        ),
        muscles=[
            (label_of(muscle), [(f"chart-{i}-{j}", quantity) for j, quantity in enumerate(known)])
            for i, (muscle, known) in enumerate(curves.items())
        ],
        tables=[_sheet(muscle, table.where(muscle=muscle)) for muscle in curves],
        data=charts,
        plotly=Markup(plotly_text()),
    )


def _chart(
    place: str, runs: Mapping[str, Curve], colours: Mapping[str, str], literature: Sequence[LiteratureCurve]
) -> dict[str, Any]:
    first = next(iter(runs.values()))
    of_arm = first.quantity.startswith("moment arm")
    coordinate = first.over.partition(" [")[0]
    published = [one for one in literature if of_arm and side_apart(one.dof).replace("_", " ") == coordinate]
    return {
        "id": place,
        "x": first.over,
        "y": f"{first.quantity} [{first.unit}]",
        "runs": [
            {
                "label": name,
                "colour": colours[name],
                **{key: rounded(getattr(one, key)) for key in ("x", "mean", "low", "high")},
                "error": None if one.error is None else rounded(one.error),
            }
            for name, one in runs.items()
        ],
        "differences": [
            {
                "label": name,
                "colour": colours[name],
                "x": rounded(apart.x),
                "mean": rounded(apart.values),
                "error": None if apart.error is None else rounded(apart.error),
            }
            for name, one in list(runs.items())[1:]
            if (apart := difference(one, first)) is not None
        ],
        "literature": published_curves(published),
    }


def _sheet(muscle: str, table: Table) -> Sheet:
    note = "Means over all frames; differences to the first run, where both are, with their errors."
    return Section(label_of(muscle), note, [row[1:] for row in shown_rows(table)]).sheet
