"""Kohout et al. 2012, Figs. 8 and 9: the gluteus medius before and after its fibres' ends are corrected.

Spread is the root mean square distance of the fibres' ends from
their mean, beside that of the points of the attachment patch: ends that meet in a point have little.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from common import Case, Floats, Table, main, picture, quietly
from scipy.spatial import cKDTree

from vtkmuscle.data.arrays import multiblock_from, point_array, points_of, polylines_of
from vtkmuscle.filters import (
    FibreSmoother,
    FibreTemplateSource,
    FibreTrimmer,
    FixedPointDetector,
    SliceMorpher,
    TemplateFitter,
)
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.pipelines import PUBLISHED_FIBRES

NAME = "gluteus_medius"


def spread(points: Floats) -> float:
    """Return the root mean square distance from the mean."""
    return float(np.sqrt(np.mean(np.sum((points - points.mean(axis=0)) ** 2, axis=1))))


def own(kind: type[Filter], chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Return those of some settings that a filter has."""
    return {name: value for name, value in chosen.items() if name in kind.parameter_declarations}


def tables(case: Case) -> list[Table]:
    """Return where the fibres end, before and after."""
    columns = (
        "end",
        "published",
        "stage",
        "spread / that of the patch",
        "ends off the patch, mean / max [mm]",
    )
    table = Table(f"Figs. 8 and 9: ends of the fibres, {NAME}", columns)
    muscle, areas = case.scene.muscles[NAME].surface, case.scene.attachments_data(NAME)
    template = FibreTemplateSource(n_fibres=100, resolution=19)()
    stages = {}
    for title, chosen in (("as published", PUBLISHED_FIBRES["kohout2012"]), ("defaults", {})):
        fitted = TemplateFitter(**own(TemplateFitter, chosen))(template, muscle, areas)
        morphed = quietly(SliceMorpher(**own(SliceMorpher, chosen)), fitted, muscle, areas)
        trimmed = FibreTrimmer(**own(FibreTrimmer, chosen))(morphed, muscle, areas)
        stages[f"{title}: before (Fig. 8)"] = morphed
        stages[f"{title}: trimmed (Fig. 9)"] = trimmed
        smoother = FibreSmoother(**own(FibreSmoother, chosen))
        stages[f"{title}: smoothed"] = smoother(trimmed) if chosen else smoother(trimmed, muscle)
    marked = FixedPointDetector().apply(muscle, case.scene.bones_data(), areas)
    fixed, places = point_array(marked, "FixedTo", NAME), points_of(marked) * case.scene.millimetres
    for bone, end in enumerate(("origin", "insertion")):
        patch = places[fixed == bone]
        tree = cKDTree(patch)
        for stage, fibres in stages.items():
            ends = ends_of(fibres, end) * case.scene.millimetres
            far = tree.query(ends)[0]
            published = "meet in a point" if "before" in stage else "spread over the area"
            ratio = spread(ends) / spread(patch)
            table.add(end, published, stage, f"{ratio:.2f}", f"{far.mean():.1f} / {far.max():.1f}")
    if case.draws:
        none = multiblock_from({})
        case.draw(
            "kohout2012_fig8_9.png", [[(s, picture(none, [muscle], fibres=f)) for s, f in stages.items()]]
        )
    return [table]


def ends_of(fibres: Any, end: str) -> Floats:
    """Return the first or last points of fibres."""
    lines = polylines_of(fibres, NAME)
    ends: Floats = lines.points[lines.offsets[:-1] if end == "origin" else lines.offsets[1:] - 1]
    return ends


if __name__ == "__main__":
    main(__doc__, tables)
