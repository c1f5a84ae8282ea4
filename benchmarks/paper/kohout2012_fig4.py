"""Kohout et al. 2012, Fig. 4: templates of parallel and pennate fibres."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from common import Case, Table, main

from vtkmuscle.core.template import TEMPLATES
from vtkmuscle.data.arrays import field_array, polylines_of
from vtkmuscle.filters import FibreTemplateSource

PUBLISHED = {"parallel": "bottom to top", "pennate": "lower side to upper side"}


def tables(case: Case) -> list[Table]:
    """Return where the fibres of each template begin and end in the unit cube."""
    columns = ("template", "published", "origin area: x, y, z", "insertion area: x, y, z")
    columns += ("angle to the axis [degrees]", "nearest starts / ideal")
    table = Table("Fig. 4: templates, 100 fibres", columns)
    for kind in TEMPLATES:
        template = FibreTemplateSource(template=kind, n_fibres=100, resolution=19)()
        lines = polylines_of(template, kind)
        first, last = lines.points[lines.offsets[:-1]], lines.points[lines.offsets[1:] - 1]
        run = last - first
        angles = np.degrees(np.arccos(run[:, 2] / np.linalg.norm(run, axis=1)))
        areas = [extent(field_array(template, area)) for area in ("OriginArea", "InsertionArea")]
        apart = np.linalg.norm(first[:, None] - first[None], axis=2) + 9.0 * np.eye(len(first))
        # As far as points of a square lattice would be that fill the part that the starts lie in.
        sides = np.sort(np.ptp(first, axis=0))[1:]
        ideal = np.sqrt(sides.prod() / len(first))
        table.add(
            kind,
            PUBLISHED.get(kind, "not drawn"),
            *areas,
            f"{angles.min():.0f} to {angles.max():.0f}",
            f"{np.median(apart.min(axis=1)) / ideal:.2f}" if ideal > 0 else "one line",
        )
        if case.draws and kind in PUBLISHED:
            plotter = pv.Plotter(off_screen=True, window_size=(500, 500))
            plotter.add_mesh(pv.Cube(bounds=(0, 1, 0, 1, 0, 1)), style="wireframe", color="black")
            plotter.add_mesh(pv.wrap(template).tube(radius=0.008), color="#c96a5a", scalars=None)
            plotter.camera_position = [(2.2, -2.6, 1.6), (0.5, 0.5, 0.5), (0, 0, 1)]
            case.draw(f"kohout2012_fig4_{kind}.png", [[(kind, plotter.screenshot(return_img=True))]])
            plotter.close()
    return [table]


def extent(area: np.ndarray | None) -> str:
    """Return the ranges of an area's corners along the cube's axes as text."""
    assert area is not None
    corners = area.reshape(-1, 3)
    ends = zip(corners.min(axis=0), corners.max(axis=0), strict=True)
    return ", ".join(f"{low:g}" if low == high else f"{low:g} to {high:g}" for low, high in ends)


if __name__ == "__main__":
    main(__doc__, tables)
