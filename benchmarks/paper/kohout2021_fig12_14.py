"""Kohout and Červenka 2021, Figs. 12 to 14: fibre lengths over hip flexion.

Lengths are smoothed five times, as in the paper. With the published settings the fibres are those that the
paper took (Kohout and Kukačka 2014), with the defaults our own. Deep fibres are the half that is nearer to
the pelvis at rest. Largest step is the most that a fibre's length changes by in 2 degrees.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from common import AS_PUBLISHED, LEFT, Case, Floats, Table, angles_up_to, main

from vtkmuscle.core.fibres.measures import smoothed_curve
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import checked_surface, polylines_of
from vtkmuscle.plotting.sheets import curves

PUBLISHED = {
    "gluteus_maximus": "all fibres lengthen",
    "gluteus_medius": "surface fibres lengthen, deep ones shorten",
    "iliacus": "an unrealistic increase beyond 70 degrees",
}
FIGURE = {"gluteus_maximus": 12, "gluteus_medius": 13, "iliacus": 14}


def lengths_over(case: Case, name: str, angles: list[float], settings: dict[str, Any]) -> Floats:
    """Return smoothed fibre lengths (angles, fibres) [mm], as far as the muscle stays among the numbers."""
    chain = case.chain(name, **settings)
    found = []
    for angle in angles:
        try:
            lines = polylines_of(chain.fibres_at(angle), name)
        except ValueError:
            break
        found.append(polyline_lengths(lines.points, lines.offsets) * case.scene.millimetres)
    smooth: Floats = np.apply_along_axis(smoothed_curve, 0, np.array(found))
    return smooth


def deep_half(case: Case, name: str, published: str | None) -> Any:
    """Return which fibres are nearer to the pelvis than half of them, at rest."""
    lines = polylines_of(case.fibres(name, published=published), name)
    far = np.abs(solids_of(*checked_surface(case.scene.bones["pelvis"], "test")).distances(lines.points))
    mean = np.add.reduceat(far, lines.offsets[:-1]) / np.diff(lines.offsets)
    return mean < np.median(mean)


def tables(case: Case) -> list[Table]:
    """Return how the lengths change."""
    columns = ("muscle", "published", "settings", "at rest [mm]", "longer at the end", "change, mean [%]")
    columns += ("surface / deep half [%]", "last 20 degrees [%]", "largest step, before 70 / after [mm]")
    table = Table("Figs. 12 to 14: fibre lengths, 0 to 90 degrees", columns)
    angles = angles_up_to(8.0 if case.short else 90.0)
    kinds: tuple[tuple[str, str | None, dict[str, Any]], ...] = (
        ("as published, 10 iterations", "kohout2014", {**AS_PUBLISHED, "iterations": 10}),
        ("the same, no bones", "kohout2014", {**AS_PUBLISHED, "iterations": 10, "collision": "off"}),
        ("defaults", None, {}),
    )
    for name, published in PUBLISHED.items():
        for title, fibres, settings in kinds:
            deep = deep_half(case, name, fibres)
            lengths = lengths_over(case, name, angles, settings)
            reached = len(lengths)
            left = f"; {LEFT} at {angles[reached]:g} degrees" if reached < len(angles) else ""
            change = 100.0 * (lengths[-1] / lengths[0] - 1.0)
            steps = np.abs(np.diff(lengths, axis=0)).max(axis=1)
            before = max(len(lengths) - 11, 1)
            late = 100.0 * (lengths[-1] / lengths[max(len(lengths) - 11, 0)] - 1.0)
            table.add(
                name,
                published,
                title + left,
                f"{lengths[0].mean():.1f}",
                f"{(change > 0.0).mean():.0%}",
                f"{change.mean():+.3g}",
                f"{change[~deep].mean():+.3g} / {change[deep].mean():+.3g}",
                f"{late.mean():+.3g}",
                f"{steps[:before].max(initial=0.0):.3g} / {steps[before:].max(initial=0.0):.3g}",
            )
            if case.out is not None:
                figure, axes = curves(
                    f"Kohout 2021, Fig. {FIGURE[name]}: {name}, {title}", "flexion", "length [mm]"
                )
                axes.plot(angles[: len(lengths)], lengths, lw=0.6)
                case.save(figure, f"kohout2021_fig{FIGURE[name]}_{title}.png")
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
