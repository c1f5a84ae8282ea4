"""The page of a study: one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import io
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from vtkmuscle._version import __version__
from vtkmuscle.cohort.statistics import Key, curves, outliers
from vtkmuscle.cohort.study import Study
from vtkmuscle.cohort.tables import part_of
from vtkmuscle.core.types import Floats
from vtkmuscle.io.csv_table import csv_rows
from vtkmuscle.io.parts import Parts
from vtkmuscle.io.writing import write_text
from vtkmuscle.run.verdict import VERDICTS

#: Most outliers that are listed.
_OUTLIERS = 50


def write_page(study: Study, parts: Parts, out: Path) -> Path:
    """Write ``cohort.html``: distributions, outliers, flags by severity, pictures of every muscle."""
    import jinja2  # noqa: PLC0415 -- only pages need it

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("vtkmuscle.cohort", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    muscles = list(_muscles(study, parts))
    found = curves(out)
    page = environment.get_template("cohort.html").render(
        study=study,
        version=__version__,
        verdicts=Counter(one["verdict"] for one in muscles if not one["sample"]),
        muscles=[one for one in muscles if one["picture"]],
        flags=_flags(muscles),
        remarks=Counter(remark for one in muscles for remark in one["remarks"]).most_common(),
        bands=list(_bands(found)),
        outliers=outliers(found)[:_OUTLIERS],
        tables=[(name, _table(out / f"{name}.csv")) for name in ("sensitivity",) if _there(out, name)],
        comparison=_there(out, "comparison"),
    )
    write_text(out / "cohort.html", page)
    return out / "cohort.html"


def _there(out: Path, name: str) -> bool:
    return (out / f"{name}.csv").is_file()


def _table(path: Path) -> list[list[str]]:
    return [cells for _, cells in csv_rows(path)]


def _muscles(study: Study, parts: Parts) -> Iterator[dict[str, Any]]:
    """Give what the page says of each task, in the order of the study."""
    for tasks in study.tasks():
        for task in tasks:
            part = part_of(task, parts)
            facts, picture = part.facts, part.arrays.get("picture")
            yield {
                **{
                    name: getattr(task, name) for name in ("subject", "motion", "setting", "sample", "muscle")
                },
                "verdict": facts.get("verdict", "failed"),
                "failure": facts.get("failure", ""),
                "reasons": facts.get("reasons", ()),
                "remarks": facts.get("remarks", ()),
                "picture": None if picture is None else base64.b64encode(picture.tobytes()).decode("ascii"),
            }


def _flags(muscles: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return what is to be looked at: failures first, then by how far a value is beyond its limit."""
    flags = []
    for one in muscles:
        if one["failure"]:
            flags.append({**one, "level": "failed", "says": one["failure"], "do": "", "beyond": float("inf")})
        for reason in one["reasons"]:
            limit, value = float(reason["limit"]), float(reason["value"])
            ratio = max(value / limit, limit / value) if limit > 0 and value > 0 else float("inf")
            level = reason["verdict"]
            flags.append({**one, "level": level, "says": reason["says"], "do": reason["do"], "beyond": ratio})
    return sorted(flags, key=lambda flag: (-VERDICTS.index(flag["level"]), -flag["beyond"]))


def _bands(found: Mapping[Key, Mapping[str, Floats]]) -> Iterator[dict[str, Any]]:
    """Give a drawing of lengths and moment arms over the subjects, per motion, setting, muscle and more."""
    alike: dict[Key, list[Mapping[str, Floats]]] = defaultdict(list)
    for (_, motion, setting, _, muscle, group, coordinate), curve in found.items():
        alike[motion, setting, muscle, group, coordinate].append(curve)
    for (motion, setting, muscle, group, coordinate), ones in alike.items():
        words = ", ".join(
            part for part in (muscle, motion, setting, f"group {group}" if group else "") if part
        )
        yield {"title": words.replace("_", " "), "n": len(ones), "svg": _drawn(coordinate, ones)}


def _drawn(coordinate: str, ones: Sequence[Mapping[str, Floats]]) -> str:
    """Return an SVG: each curve thin, the median, and the band that holds 90 % of them."""
    figure = Figure(figsize=(7.6, 2.4), layout="constrained")
    FigureCanvasSVG(figure)
    same = len({one["value"].tobytes() for one in ones}) == 1
    names = (("length_mm", "length [mm]"), ("moment_arm_mm", "moment arm [mm]"))
    for axes, (measure, label) in zip(figure.subplots(1, 2), names, strict=True):
        for one in ones[:200]:
            axes.plot(one["value"], one[measure], color="#4a6b8a", linewidth=0.4, alpha=0.35)
        if same and len(ones) >= 3:
            values = np.array([one[measure] for one in ones])
            low, middle, high = np.percentile(values, (5, 50, 95), axis=0)
            axes.fill_between(ones[0]["value"], low, high, color="#4a6b8a", alpha=0.25, linewidth=0)
            axes.plot(ones[0]["value"], middle, color="#16324f", linewidth=1.6)
        axes.set_xlabel(coordinate.replace("_", " "), fontsize=8)
        axes.set_ylabel(label, fontsize=8)
        axes.tick_params(labelsize=7)
    file = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": coordinate}):  # the same drawing each time
        figure.savefig(file, format="svg", metadata={"Date": None})
    text = file.getvalue()
    return text[text.index("<svg") :]
