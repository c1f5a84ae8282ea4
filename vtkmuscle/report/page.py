"""The report of a run as a self-contained page, and pages of sections."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from operator import contains
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import jinja2
import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from vtkmuscle import __version__
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.types import Floats
from vtkmuscle.data import package_text
from vtkmuscle.io.literature import label_of
from vtkmuscle.io.writing import write_text
from vtkmuscle.report.data import MEASURES, QUANTITIES, Pack, curves_of, scene_of

if TYPE_CHECKING:
    from vtkmuscle.run.result import Result

#: Placeholder for a missing number.
DASH = "\u2013"


def number(value: Any, digits: int = 3) -> str:
    """Return a number as text, or a dash."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return DASH
    size = abs(float(value))
    if size < 5e-7:
        return "0"
    if size >= 10.0 ** (digits - 1):
        return f"{value:,.0f}".replace(",", "\u202f").replace("-", "\u2212")
    decimals = max(0, digits - 1 - int(np.floor(np.log10(size))))
    return (f"{value:.{decimals}f}" if size >= 1e-3 else f"{value:.1e}").replace("-", "\u2212")


class Cell(NamedTuple):
    """A cell with a mark, ``"look"``, ``"failed"`` or ""."""

    text: str
    mark: str


@dataclass(frozen=True)
class Section:
    """A section of a page. A table with a header, in which verdicts are marked, and SVG drawings.

    ``words`` says that cells are words rather than numbers; drawings are titles and SVG.
    """

    title: str
    note: str = ""
    rows: Sequence[Sequence[str | Cell]] = ()
    words: bool = False
    drawings: Sequence[tuple[str, Mapping[str, Any]]] = ()


def write_sections(
    path: Path, name: str, kind: str, lead: str, sections: Sequence[Section], template: str = "sections.html",
    **values: Any,
) -> None:  # fmt: skip
    """Write a page of a kind, with further values of a template."""
    write_text(path, rendered(template, name=name, kind=kind, lead=lead, sections=sections, **values))


def part(name: str) -> Markup:
    """Return a file of the page unescaped. The package's files contain no end of a script."""
    return Markup(package_text("vtkmuscle.report", f"page/{name}"))


@cache
def _environment() -> jinja2.Environment:
    spaces: dict[str, Any] = {"trim_blocks": True, "lstrip_blocks": True, "keep_trailing_newline": True}
    loader = jinja2.PackageLoader("vtkmuscle.report", "page")
    strict = jinja2.StrictUndefined
    environment = jinja2.Environment(loader=loader, autoescape=True, undefined=strict, **spaces)
    environment.globals["part"], environment.tests["contains"] = part, contains
    environment.filters |= {"number": number, "label": label_of, "file_name": lambda path: Path(path).name}
    return environment


def rendered(template: str, **values: Any) -> str:
    """Return the text of a page from a template in ``page``."""
    return _environment().get_template(template).render(version=__version__, **values)


def shown_rows(table: Mapping[str, NDArray[Any]]) -> list[Sequence[str]]:
    """Return a table's header and rows as text, with four digits. A missing number is ""."""
    return [tuple(table), *zip(*(map(_shown, column.tolist()) for column in table.values()), strict=True)]


def _shown(value: Any) -> str:
    if value is None or value != value:  # noqa: PLR0124
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def svg_curve(x: Floats, y: Floats, x_unit: str, size: tuple[int, int] = (220, 50)) -> dict[str, Any]:
    """Return moment arms for SVG. With zero line and numbers at the ends; without outliers as at jumps.

    Arms are in mm by an angle, in thousandths by a translation; ``size`` is width and height [pixels].
    """
    low, high = np.clip(np.percentile(y, [2.0, 98.0]), [-np.inf, 0.0], [0.0, np.inf])
    (width, height), unit = size, "\u2030" if x_unit == "m" else "mm"
    across = width * (x - x[0]) / np.ptp(x)
    up, zero = height * (high - np.array([np.clip(y, low, high), 0.0 * y])) / ((high - low) or 1.0)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up, strict=True))
    labels = [(-4, 9, "end", f"{high:.0f} {unit}"), (-4, height, "end", f"{low:.0f}")]
    labels += [(0, height + 13, "start", f"{x[0]:.4g}"), (width, height + 13, "end", f"{x[-1]:.4g} {x_unit}")]
    return {"size": size, "points": points, "zero": f"{zero[0]:.1f}", "labels": labels}


def page_of(run: "Result", many: int = 6) -> str:
    """Return the page of a run as text. The page needs no external resources.

    ``many`` is the number of muscles above which the cards are collapsed.
    """
    report, pack = run.report, Pack()
    return rendered(
        "report.html",
        run=run,
        many=many,
        span=[number(run.times[0]), number(run.times[-1])],
        angles=ANGLES,
        quantities=QUANTITIES,
        quality=_quality(report["muscles"]),
        not_checked=not_checked_of(report),
        settings=settings_of(report),
        data={"scene": scene_of(run, pack), "curves": curves_of(run, pack), "frames": list(run.frames)},
        arrays=Markup(pack.text()),
    )


def not_checked_of(report: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Return a table of omitted checks, with the reasons."""
    muscles: dict[tuple[str, str], list[str]] = {}
    for name, muscle in report["muscles"].items():
        for check, why in muscle.get("verdict", {}).get("not_checked", {}).items():
            muscles.setdefault((check, str(why)), []).append(label_of(name))
    rows = [("check", "why", "muscles")]
    for (check, why), names in muscles.items():
        listed = "all muscles" if len(names) == len(report["muscles"]) else ", ".join(names)
        rows.append((label_of(check), why, listed))
    return rows


def settings_of(report: Mapping[str, Any]) -> list[tuple[str, list[tuple[str, str]]]]:
    """Return the parameters of muscles, grouped by equal parameters."""
    groups: dict[str, list[str]] = {}
    for name, muscle in report["muscles"].items():
        parameters = json.dumps(muscle.get("parameters", {}), sort_keys=True, default=str)
        groups.setdefault(parameters, []).append(label_of(name))
    return [(", ".join(names), list(_flat(json.loads(text)))) for text, names in groups.items()]


def _flat(values: Mapping[str, Any], before: str = "") -> Iterable[tuple[str, str]]:
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", "none" if value is None else str(value)


def _quality(muscles: Mapping[str, Any]) -> Section:
    listed = [measure for measure in MEASURES if measure.head]
    series = {
        name: {each: (values := each.of(muscle["frames"]))[np.isfinite(values)] for each in listed}
        for name, muscle in muscles.items()
    }
    columns = [measure for measure in listed if any(len(values[measure]) for values in series.values())]
    rows: list[tuple[str | Cell, ...]] = [("muscle", "frames", *(measure.head for measure in columns))]
    for name, muscle in muscles.items():
        reasons = muscle.get("verdict", {}).get("reasons", ())
        marks = {reason["check"]: reason["verdict"] for reason in reasons}
        cells = [
            Cell(number(float(getattr(np, measure.of_all)(np.abs(values)))), marks.get(measure.check, ""))
            if len(values := series[name][measure])
            else DASH
            for measure in columns
        ]
        rows.append((label_of(name), str(len(muscle["frames"])), *cells))
    return Section("Quality", "Worst frame unless stated otherwise; a coloured value needs a check.", rows)
