"""Kohout, Cervenka 2021, Figs. 3, 4, 5, 8 and 10 again: ``python p21_figures.py OUT [--scene SCENE]``.

Pictures go to the folder OUT. SCENE is a scene.toml with an ``iliacus`` (the right hip of the LHDL data set,
as in the paper); without it the phantom hip is taken. Muscles are deformed with the paper's own settings but
where the title says otherwise.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pyvista as pv
from matplotlib import pyplot as plt

from vtkmuscle import RigidMotion, Scene, phantoms
from vtkmuscle.core.voxels import build_voxel_grid
from vtkmuscle.filters import FixedPointDetector
from vtkmuscle.filters.arrays import checked_surface, multiblock_from
from vtkmuscle.pipelines import deform
from vtkmuscle.plotting import choose_view, make_plotter
from vtkmuscle.plotting.views import View

PAPER = {
    "start": "inertial",
    "solver": "gauss-seidel",
    "order": "sequential",
    "collision": "voxel",
    "bone_push": "transform",
    "contact_velocity": "keep",
    "anisotropy": "stiffness",
}
EQUAL = 64**3
FINE = 8 * 64**3
FLEXION = 40.0
ITERATIONS = (1, 3, 5, 10, 100)


def voxels_of(bone: Any, **settings: int) -> pv.PolyData:
    """Return the faces of a bone's boundary and inside voxels."""
    grid = build_voxel_grid(*checked_surface(bone, "bone"), **settings)
    image = pv.ImageData(dimensions=np.array(grid.cells.shape) + 1, spacing=grid.spacing, origin=grid.origin)
    image.cell_data["state"] = grid.cells.ravel(order="F")
    return image.threshold(0.5, scalars="state").extract_surface(algorithm="dataset_surface").triangulate()


def picture(bones: Any, muscles: Sequence[Any], view: View | None = None, **options: Any) -> np.ndarray:
    """Return the pixels of a picture, if no view is given from where the bones hide least of the muscles."""
    if view is None:
        view = choose_view(list(muscles), [bones] * len(muscles))
    plotter = make_plotter(bones, muscles, view, **options)
    pixels = plotter.screenshot(return_img=True)
    plotter.close()
    return np.asarray(pixels)


def sheet(path: Path, rows: Sequence[Sequence[tuple[str, np.ndarray]]]) -> None:
    """Write rows of titled pictures to a file."""
    figure, axes = plt.subplots(
        len(rows), len(rows[0]), figsize=(3.2 * len(rows[0]), 3.6 * len(rows)), squeeze=False
    )
    for line, row in zip(axes, rows, strict=True):
        for axis, (title, pixels) in zip(line, row, strict=True):
            axis.imshow(pixels)
            axis.set_title(title, fontsize=8)
            axis.axis("off")
    figure.tight_layout()
    figure.savefig(path, dpi=120)
    plt.close(figure)
    print(path)


def figure_3(scene: Scene, out: Path) -> None:
    """Voxels of the bones: equal numbers per axis, then two totals shared out by the box's sides."""
    rows = []
    for name, bone in scene.bones.items():
        row = []
        for title, settings in (
            ("64 per axis", {"n_equal": 64}),
            (f"{EQUAL}", {"n_max": EQUAL}),
            (f"{FINE}", {"n_max": FINE}),
        ):
            voxels = voxels_of(bone, **settings)
            row.append(
                (f"{name}: {title}", picture(multiblock_from({name: voxels}), [voxels], show_muscles=False))
            )
        rows.append(row)
    sheet(out / "fig3_voxels.png", rows)


def figure_4_and_5(scene: Scene, out: Path) -> None:
    """Mark the fixed points of two muscles by all methods."""
    detectors = {
        f"collision, {EQUAL}": {"method": "collision", "n_max": EQUAL},
        "proximity, mean edge": {"method": "proximity"},
        "proximity, 0.5 mm": {"method": "proximity", "tolerance": 0.5 / scene.millimetres},
        "proximity, 1 mm": {"method": "proximity", "tolerance": 1.0 / scene.millimetres},
        "attachment": {"method": "attachment"},
    }
    rows = []
    for name in ("gluteus_maximus", "iliacus"):
        row = []
        for title, settings in detectors.items():
            areas = scene.attachments_data(name)
            fixed = FixedPointDetector(**settings).apply(
                scene.muscles[name].surface, scene.bones_data(), areas
            )
            n_fixed = int((np.array(fixed["FixedTo"]) >= 0).sum())
            none = multiblock_from({})
            row.append((f"{name}: {title}\n{n_fixed} points", picture(none, [fixed], fixed_points=True)))
        rows.append(row)
    sheet(out / "fig4_5_fixed_points.png", rows)


def flexed(
    scene: Scene, name: str, *, fixed: str, degrees: float = FLEXION, **solver: Any
) -> tuple[Any, Any]:
    """Return the bones and a muscle at a flexion."""
    times = [time for time in scene.motion.times if time <= degrees]
    motion = RigidMotion(
        np.array(times), {bone: table[: len(times)] for bone, table in scene.motion.transforms.items()}
    )
    detector = FixedPointDetector(method=fixed, n_max=FINE)
    bones, areas = scene.bones_data(), scene.attachments_data(name)
    marked = detector.apply(scene.muscles[name].surface, bones, areas)
    chain = deform(marked, bones, motion, fixed=None, **solver)
    muscle = chain.update(time=times[-1]).output
    return chain.GetInputDataObject(1, 0), muscle


def figure_8(scene: Scene, out: Path) -> None:
    """Vary iterations and anisotropy, with points fixed by collision and by attachment."""
    name = "adductor_brevis" if "adductor_brevis" in scene.muscles else "gluteus_medius"
    rows = [
        [
            (
                f"{fixed}, anisotropy {anisotropy}, {count}",
                flexed(scene, name, fixed=fixed, **{**PAPER, "iterations": count, "anisotropy": anisotropy}),
            )
            for count in ITERATIONS
        ]
        for fixed in ("collision", "attachment")
        for anisotropy in ("off", "stiffness")
    ]
    sheet(out / "fig8_iterations.png", seen_alike(rows))


def seen_alike(rows: Sequence[Sequence[tuple[str, tuple[Any, Any]]]]) -> list[list[tuple[str, np.ndarray]]]:
    """Return titled pictures of bones and muscles, all from where the last shows most."""
    bones, muscle = rows[-1][-1][1]
    view = choose_view([muscle, rows[0][0][1][1]], [bones, bones])
    return [[(title, picture(pose[0], [pose[1]], view)) for title, pose in row] for row in rows]


def figure_10(scene: Scene, out: Path) -> None:
    """Flex the iliacus fixed by collision, by attachment with and without the bone's push, and by default."""
    off = {**PAPER, "bone_push": "off"}
    row = []
    for title, fixed, settings in (
        ("fixed by collision", "collision", PAPER),
        ("fixed by attachment", "attachment", PAPER),
        ("attachment, bone_push off", "attachment", off),
        ("attachment, defaults", "attachment", {}),
    ):
        pose = flexed(scene, "iliacus", fixed=fixed, iterations=5 if settings else 10, **settings)
        row.append((title, pose))
    sheet(out / "fig10_iliacus.png", seen_alike([row]))


FIGURES = {"3": figure_3, "4": figure_4_and_5, "8": figure_8, "10": figure_10}


def main() -> None:
    """Draw the figures that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--scene", type=Path, default=None)
    parser.add_argument("--figures", nargs="+", choices=FIGURES, default=list(FIGURES))
    asked = parser.parse_args()
    mpl.use("agg")
    scene = Scene.load(asked.scene) if asked.scene else Scene.from_phantom(phantoms.hip())
    asked.out.mkdir(parents=True, exist_ok=True)
    for number in asked.figures:
        FIGURES[number](scene, asked.out)


if __name__ == "__main__":
    main()
