"""The page of a checked model: findings, each with its moment arms over the sweep."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from vtkmuscle._version import __version__
from vtkmuscle.io.writing import write_text
from vtkmuscle.opensim.checking import Finding, ModelCheck

#: Width and height of a curve [pixels].
_SIZE = (220, 50)
_STYLE = """
body { font: 14px/1.4 sans-serif; margin: 2em; max-width: 80em }
td, th { padding: 0.2em 0.8em; text-align: left; border-bottom: 1px solid #ddd; vertical-align: middle }
td.number { text-align: right; font-variant-numeric: tabular-nums } polyline { fill: none; stroke: #06c }
line { stroke: #bbb }
"""


def write_check_page(found: ModelCheck, out: Path) -> None:
    """Write the findings of a model as one file of HTML."""
    table = found.table()
    rows = "".join(
        f"<tr><td>{escape(muscle)}</td><td>{escape(name)}</td><td>{escape(what)}</td>"
        f'<td class="number">{size:.1f}</td><td>{escape(pose)}</td><td>{_curve(one)}</td></tr>\n'
        for muscle, name, what, size, pose, one in zip(
            *(table[column] for column in ("muscle", "coordinate", "what", "size_mm", "pose")),
            found.findings,
            strict=True,
        )
    )
    write_text(
        out,
        f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{escape(found.model.name)}</title>
<style>{_STYLE}</style></head><body>
<h1>{escape(found.model.name)}</h1>
<p>{escape(evaluated(found))}</p>
<table><tr><th>muscle</th><th>coordinate</th><th>what</th><th>mm</th><th>pose [degrees, m]</th>
<th>moment arm over the sweep</th></tr>
{rows}</table>
<p>vtkmuscle {__version__}</p></body></html>
""",
    )


def evaluated(found: ModelCheck) -> str:
    """Return which muscles were evaluated, and by what."""
    own = len(found.model.muscles) - len(found.by_opensim) - len(found.not_checked)
    words = f"{own} of {len(found.model.muscles)} muscles evaluated here"
    if found.by_opensim:
        words += f", {len(found.by_opensim)} that wind round surfaces by OpenSim"
    if found.not_checked:
        names = ", ".join(found.not_checked)
        words += f"; not evaluated, for they wind round surfaces and OpenSim is not installed: {names}"
    return words + "."


def _curve(one: Finding) -> str:
    """Return the moment arms over the sweep as a drawing, those of a jump left out."""
    low, high = np.percentile(one.arms, [2.0, 98.0])
    low, high = min(low, 0.0), max(high, 0.0)
    width, height = _SIZE
    x = width * (one.values - one.values[0]) / (one.values[-1] - one.values[0])
    y = height * (high - np.clip(one.arms, low, high)) / ((high - low) or 1.0)
    zero = height * high / ((high - low) or 1.0)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return (
        f'<svg width="{width}" height="{height + 2}" viewBox="0 -1 {width} {height + 2}">'
        f'<line x1="0" x2="{width}" y1="{zero:.1f}" y2="{zero:.1f}"/><polyline points="{points}"/></svg>'
    )
