"""Kohout et al. 2012, Fig. 6: the box that fits a muscle best.

They show the sartorius, which the data set lacks. The error is the sum over the eight corners of the
template's areas of the distance to the nearest landmark.
"""

from __future__ import annotations

import numpy as np
import pyvista as pv
from common import Case, Table, main, picture

from vtkmuscle.data.arrays import field_array, multiblock_from
from vtkmuscle.filters import FibreTemplateSource, TemplateFitter


def tables(case: Case) -> list[Table]:
    """Return the error of the fit, by the axis."""
    columns = (
        "muscle",
        "published",
        "attachments, 5 degrees (Kohout 2012)",
        "principal, 5 degrees (Kohout 2012)",
        "auto, 5 degrees",
    )
    columns += ("box [mm]",)
    table = Table("Fig. 6: error of the fit [mm]", columns)
    settings = ({"axis": "attachments"}, {"axis": "principal"}, {"axis": "auto"})
    template = FibreTemplateSource(n_fibres=50, resolution=19)()
    row = []
    for name in case.muscles:
        muscle, areas = case.scene.muscles[name].surface, case.scene.attachments_data(name)
        fits = [TemplateFitter(**chosen)(template, muscle, areas) for chosen in settings]
        errors = [float(field_array(fit, "FitError")[0]) * case.scene.millimetres for fit in fits]
        transform = np.reshape(field_array(fits[2], "Transform"), (4, 4))
        sides = np.linalg.norm(transform[:3, :3], axis=0) * case.scene.millimetres
        table.add(
            name,
            "not given",
            *(f"{error:.1f}" for error in errors),
            " x ".join(f"{side:.0f}" for side in sides),
        )
        if case.draws:
            box = pv.Cube(bounds=(0, 1, 0, 1, 0, 1)).transform(transform, inplace=False)
            edges = box.extract_all_edges().tube(radius=0.6 / case.scene.millimetres).triangulate()
            row.append((name, picture(multiblock_from({"box": edges}), [muscle], fibres=fits[2])))
    if case.draws:
        case.draw("kohout2012_fig6.png", [row])
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
