"""The picture of the atlas, drawn by the build from its numbers."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from sphinx.application import Sphinx


def draw(app: Sphinx) -> None:
    """Draw the bands of moment arms over flexion into ``pictures/atlas``."""
    docs = Path(app.confdir)
    with (docs / "explanation" / "atlas_tables" / "bands.csv").open(newline="") as lines:
        rows = list(csv.DictReader(lines))
    muscles = list(dict.fromkeys(row["muscle"] for row in rows))
    figure = Figure(figsize=(9.0, 3.0), layout="constrained")
    for axes, muscle in zip(figure.subplots(1, len(muscles)), muscles, strict=True):
        mine = [row for row in rows if row["muscle"] == muscle]
        angles = [float(row["flexion_deg"]) for row in mine]
        for low, high, shade in (("p5", "p95", 0.2), ("p25", "p75", 0.35)):
            edges = ([float(row[name]) for row in mine] for name in (low, high))
            axes.fill_between(angles, *edges, color="#4a6b8a", alpha=shade, linewidth=0)
        axes.plot(angles, [float(row["p50"]) for row in mine], color="#16324f")
        axes.axhline(0.0, color="#999999", linewidth=0.6)
        axes.set_title(muscle.replace("_", " "))
        axes.set_xlabel("flexion [deg]")
    figure.axes[0].set_ylabel("moment arm [mm]")
    out = docs / "pictures" / "atlas"
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "moment_arms.svg")


def setup(app: Sphinx) -> dict[str, Any]:
    """Draw before pages are read."""
    app.connect("builder-inited", draw)
    return {"parallel_read_safe": True}
