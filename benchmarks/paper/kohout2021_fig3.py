"""Kohout and Červenka 2021, Fig. 3: bones as voxels."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyvista as pv
from common import EQUAL, FINE, Case, Table, main, picture

from vtkmuscle.core.pbd.voxels import VoxelGrid, build_voxel_grid
from vtkmuscle.data.arrays import checked_surface, multiblock_from
from vtkmuscle.plotting import choose_view

SETTINGS: dict[str, dict[str, int]] = {
    "64 per axis": {"n_equal": 64},
    f"n_max {EQUAL}": {"n_max": EQUAL},
    f"n_max {FINE}": {"n_max": FINE},
}
PUBLISHED = {
    "pelvis": ("64 x 64 x 64", "47 x 64 x 85", "95 x 128 x 171"),
    "femur": ("64 x 64 x 64", "42 x 176 x 34", "85 x 352 x 69"),
}


def faces(grid: VoxelGrid) -> Any:
    """Return the outer faces of a bone's voxels."""
    image = pv.ImageData(dimensions=np.array(grid.cells.shape) + 1, spacing=grid.spacing, origin=grid.origin)
    image.cell_data["state"] = grid.cells.ravel(order="F")
    return image.threshold(0.5, scalars="state").extract_surface(algorithm="dataset_surface").triangulate()


def tables(case: Case) -> list[Table]:
    """Return the sizes of the grids."""
    table = Table("Fig. 3: voxels", ("bone", "cells", "published", "ours", "side [mm]", "boundary", "inside"))
    rows = []
    for name, bone in case.scene.bones.items():
        row = []
        published = PUBLISHED[name.split("_")[0]] if case.real else ("",) * 3
        chosen = list(SETTINGS.items())[: 2 if case.short else 3]
        for (title, settings), theirs in zip(chosen, published, strict=False):
            grid = build_voxel_grid(*checked_surface(bone, name), **settings)
            counts = np.bincount(grid.cells.ravel(), minlength=3)
            table.add(
                name,
                title,
                theirs,
                " x ".join(str(n) for n in grid.cells.shape),
                " x ".join(f"{side:.1f}" for side in grid.spacing),
                counts[1],
                counts[2],
            )
            if case.draws:
                voxels = faces(grid)
                shown = multiblock_from({name: voxels})
                pixels = picture(shown, [], choose_view([voxels], [shown]))
                row.append((f"{name}: {title}", pixels))
        rows.append(row)
    if case.draws:
        case.draw("kohout2021_fig3.png", rows)
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
