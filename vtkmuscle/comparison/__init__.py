"""Runs compared muscle by muscle: settings, sides, subjects, published curves, OpenSim's own paths."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any

from markupsafe import Markup

from vtkmuscle.comparison.curves import (
    Curve,
    curves_of,
    curves_of_model,
    difference,
    figures_of,
    mean_square_root,
)
from vtkmuscle.core.errors import InputError
from vtkmuscle.io.literature import LiteratureCurve, curves_for, read_literature, side_apart
from vtkmuscle.io.writing import write_text
from vtkmuscle.opensim import read_osim
from vtkmuscle.report.curves import colour_of, label_of, published_curves, rounded
from vtkmuscle.report.sections import part, plotly_text, rendered, shown_rows
from vtkmuscle.report.tables import Sheet
from vtkmuscle.run.result import Result
from vtkmuscle.run.table import Table

#: Columns of the table: a row for each muscle, quantity and run. Differences are to the first run, where both
#: have values; ``difference_err`` is the root mean square of their error, ``at`` the position of the largest.
COLUMNS = (
    *("muscle", "quantity", "unit", "run", "verdict", "mean", "mean_err"),
    *("difference", "difference_rms", "difference_largest", "at", "difference_err"),
)


@dataclass(eq=False, repr=False)
class Comparison:
    """The result of :func:`compare`.

    Attributes
    ----------
    names : list of str
        Of the runs; the others are compared to the first.
    curves : dict of str to dict of str to dict of str to Curve
        By muscle, quantity and run.
    literature : dict of str to tuple of LiteratureCurve
        By muscle.
    verdicts : dict of (str, str) to str
        By muscle and run.
    """

    names: list[str] = field(default_factory=list)
    curves: dict[str, dict[str, dict[str, Curve]]] = field(default_factory=dict)
    literature: dict[str, tuple[LiteratureCurve, ...]] = field(default_factory=dict)
    verdicts: dict[tuple[str, str], str] = field(default_factory=dict)

    def __repr__(self) -> str:
        return f"Comparison of {', '.join(self.names)}: {', '.join(self.curves)}"

    def table(self) -> Table:
        """Return means and differences to the first run, a row per muscle, quantity and run."""
        return Table(COLUMNS, self._rows())

    def write(self, folder: str | PathLike[str]) -> list[Path]:
        """Write ``comparison.html``, the curves, and ``comparison.csv``, the table; return both."""
        place = Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        write_text(place / "comparison.html", page_of(self))
        return [place / "comparison.html", self.table().to_csv(place / "comparison.csv", digits=6)]

    def add(self, name: str, muscle: str, curves: Sequence[Curve], verdict: str = "") -> None:
        """Add the curves of a muscle in a run."""
        key = side_apart(muscle)
        known = self.curves.setdefault(key, {})
        if any(name in found for found in known.values()):
            name = f"{name}, {muscle}"  # both sides of one run
        for curve in curves:
            known.setdefault(curve.quantity, {})[name] = curve
        self.verdicts[key, name] = verdict
        if name not in self.names:
            self.names.append(name)

    def _rows(self) -> Iterator[tuple[object, ...]]:
        for muscle, quantities in self.curves.items():
            for quantity, runs in quantities.items():
                first = next(iter(runs.values()))
                for name, curve in runs.items():
                    row = (muscle, quantity, curve.unit, name, self.verdicts[muscle, name])
                    apart = None if curve is first else difference(curve, first)
                    figures = (None,) * 5 if apart is None else figures_of(apart)
                    yield *row, float(curve.mean.mean()), mean_square_root(curve.error), *figures


def compare(
    results: Mapping[str, Result] | Sequence[Result | str | PathLike[str]],
    *,
    literature: str | PathLike[str] | None = None,
    opensim: str | PathLike[str] | None = None,
) -> Comparison:
    """Compare runs: settings, sides, subjects, and published values.

    Muscles and coordinates are matched by their names, without the side (``_r``, ``_l``); both sides of one
    run count as two runs.

    Parameters
    ----------
    results : mapping of str to Result, or sequence of Result or path
        Runs by a name, or runs and folders of results with names of their own. The others are compared to the
        first.
    literature : path, optional
        Published moment arms as of :func:`vtkmuscle.io.read_literature`; by default those of the runs.
    opensim : path, optional
        An .osim whose muscles of the same names are one more run, in the poses of the first run.

    Returns
    -------
    Comparison
        ``table()`` gives the differences, ``write(folder)`` writes the page and the table.

    Raises
    ------
    ValueError
        If no muscle is in two of the runs, or a file cannot be read.

    Warns
    -----
    UserWarning
        For muscles of the model whose paths wind round surfaces, which are not computed here.

    Examples
    --------
    >>> import vtkmuscle
    >>> scene = vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.spindle_over_hinge(), n_fibres=8)
    >>> runs = {name: scene.with_quality(name).run(frames="0:2") for name in ("preview", "balanced")}
    >>> compared = vtkmuscle.compare(runs)
    >>> compared
    Comparison of preview, balanced: spindle
    >>> compared.table().where(run="balanced", quantity="fibre length")["unit"]
    array(['mm'], dtype='<U2')
    """
    named = dict(results) if isinstance(results, Mapping) else _named(results)
    found = Comparison()
    published = None if literature is None else read_literature(literature)
    for name, result in named.items():
        for muscle in result.muscle_names:
            found.add(name, muscle, curves_of(result, muscle), result.verdicts[muscle])
            curves = result.literature.get(muscle, ()) if published is None else published
            found.literature.setdefault(side_apart(muscle), curves_for(curves, muscle=muscle))
    if opensim is not None:
        _add_model(found, Path(opensim), next(iter(named.values())))
    shared = any(len(runs) > 1 for known in found.curves.values() for runs in known.values())
    if not shared and not any(found.literature.values()):
        listed = "; ".join(f"{name}: {', '.join(one.muscle_names)}" for name, one in named.items())
        raise InputError("", f"no muscle is in two of what is compared ({listed})", "muscles match by name")
    return found


def _named(results: Sequence[Result | str | PathLike[str]]) -> dict[str, Result]:
    if isinstance(results, str | PathLike):
        results = [results]
    found: dict[str, Result] = {}
    for one in results:
        result = Result.load(one) if isinstance(one, str | PathLike) else one
        name = Path(one).name if isinstance(one, str | PathLike) else one.name
        number = sum(known == name or known.startswith(f"{name} (") for known in found)
        found[f"{name} ({number + 1})" if number else name] = result
    return found


def _add_model(found: Comparison, path: Path, result: Result) -> None:
    model, left_out = read_osim(path), []
    for muscle in model.muscles:
        if side_apart(muscle) in found.curves:
            try:
                found.add(path.name, muscle, curves_of_model(model, muscle, result))
            except InputError as error:
                left_out.append(f"{muscle}: {error}")
    if left_out:
        warnings.warn(f"{path.name} is not compared for {'; '.join(left_out)}", stacklevel=3)


def page_of(found: Comparison) -> str:
    """Return the page as text: curves over one another, differences to the first run, and the table."""
    colours = {name: colour_of(k) for k, name in enumerate(found.names)}
    muscles, charts = [], []
    for i, (muscle, known) in enumerate(found.curves.items()):
        places = {quantity: f"chart-{i}-{j}" for j, quantity in enumerate(known)}
        muscles.append((label_of(muscle), [(place, quantity) for quantity, place in places.items()]))
        literature = found.literature.get(muscle, ())
        charts += [_chart(places[quantity], runs, colours, literature) for quantity, runs in known.items()]
    own = (files("vtkmuscle.comparison") / "page" / "comparison.js").read_text(encoding="utf-8")
    parts = [part(f"{name}.js") for name in ("arrays", "colours", "curves", "saving")]
    table = found.table()
    return rendered(
        "comparison.html",
        ("vtkmuscle.comparison", "page"),
        names=found.names,
        colours=colours,
        script=Markup("\n").join([*parts, Markup(own)]),
        muscles=muscles,
        tables=[_sheet(muscle, table.where(muscle=muscle)) for muscle in found.curves],
        data=charts,
        plotly=Markup(plotly_text()),
    )


def _chart(
    place: str, runs: Mapping[str, Curve], colours: Mapping[str, str], literature: Sequence[LiteratureCurve]
) -> dict[str, Any]:
    """Return the data of a chart for the page's script."""
    first, *others = runs.values()
    apart = {name: difference(one, first) for name, one in zip(list(runs)[1:], others, strict=True)}
    of_arm = first.quantity.startswith("moment arm")
    coordinate = first.over.partition(" [")[0]
    published = [one for one in literature if of_arm and side_apart(one.dof).replace("_", " ") == coordinate]
    return {
        "id": place,
        "x": first.over,
        "y": f"{first.quantity} [{first.unit}]",
        "runs": [_line(name, colours[name], one) for name, one in runs.items()],
        "differences": [_line(name, colours[name], one) for name, one in apart.items() if one is not None],
        "literature": published_curves(published),
    }


def _line(name: str, colour: str, curve: Curve) -> dict[str, Any]:
    error = None if curve.error is None else rounded(curve.error)
    return {
        "label": name,
        "colour": colour,
        "x": rounded(curve.x),
        "mean": rounded(curve.mean),
        "error": error,
    }


def _sheet(muscle: str, table: Table) -> Sheet:
    note = "Means over all frames; differences to the first run, where both have values, with their errors."
    return Sheet(note, [row[1:] for row in shown_rows(table)])
