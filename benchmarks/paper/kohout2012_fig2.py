"""Kohout et al. 2012, Fig. 2: parallel fibres mapped into a muscle."""

from __future__ import annotations

import numpy as np
from common import Case, Table, main, picture, quietly

from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import checked_surface, multiblock_from, polylines_of
from vtkmuscle.filters import FibreTemplateSource, SliceMorpher, TemplateFitter

#: Nearer to the surface than this is not outside of it [mm].
TOLERANCE = 0.1


def tables(case: Case) -> list[Table]:
    """Return how many points of the mapped fibres leave the muscle."""
    columns = ("muscle", "published", "fibre points outside", "method")
    table = Table(f"Fig. 2: 50 fibres of 19 segments; outside is more than {TOLERANCE:g} mm", columns)
    row = []
    template = FibreTemplateSource(n_fibres=50, resolution=19)()
    for name in case.muscles:
        muscle, areas = case.scene.muscles[name].surface, case.scene.attachments_data(name)
        fitted = TemplateFitter()(template, muscle, areas)
        distance = solids_of(*checked_surface(muscle, "test"))
        points = polylines_of(quietly(SliceMorpher(method="plane"), fitted, muscle, areas), name).points
        far = np.where(distance.depth(points) > 0.0, 0.0, np.abs(distance.distances(points)))
        outside = int((far * case.scene.millimetres > TOLERANCE).sum())
        table.add(name, "in the muscle", f"{outside} of {len(points)}", "plane")
        if case.draws:
            fibres = quietly(SliceMorpher(method="plane"), fitted, muscle, areas)
            row += [(f"{name}, template", picture(multiblock_from({}), [muscle], fibres=fitted))]
            row += [(f"{name}, mapped", picture(multiblock_from({}), [muscle], fibres=fibres))]
    if case.draws:
        case.draw("kohout2012_fig2.png", [row])
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
