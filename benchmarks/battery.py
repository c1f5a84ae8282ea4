"""Run every muscle of some scenes with the defaults, and tell how each fared.

Run as ``python benchmarks/battery.py [SCENE.toml ...] [--pictures FILE] [--rst FOLDER]``. Without scenes: all
that are in folders beside the real hip (``VTKMUSCLE_DATA``). A row per muscle: verdict, what it is for, how
far a path leaves the straight line between the frames before and after (95th percentile, largest), the
largest share of the surface that is out of shape, the largest change of the angles between triangles (95th
percentile), steps of Newton's method in a frame (median / most), and the time of a frame. ``--pictures``
draws all muscles in their last frame on one sheet.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyvista as pv
from how_right import Table
from real_hip import data_folder

from vtkmuscle import Result, Scene
from vtkmuscle.data.arrays import blocks_of

HEADER = (
    "scene",
    "muscle",
    "verdict",
    "for",
    "bend p95 [mm]",
    "largest [mm]",
    "misshapen [%]",
    "angles [deg]",
    "steps",
    "frame [ms]",
)
#: Pixels of a picture.
SIZE = 420


def scenes() -> list[Path]:
    """Return the scenes that are run where none is named."""
    found = sorted(data_folder().parent.glob("*/*.toml"))
    return [path for path in found if not path.stem.endswith(("_lite", "_estimate"))]


def bend(lengths: np.ndarray, radians: np.ndarray) -> np.ndarray:
    """Return how far arms of lengths (f, k) are off the line between the frames before and after [mm]."""
    arms = -np.gradient(lengths, radians, axis=0)
    return np.abs(arms[1:-1] - (arms[:-2] + arms[2:]) / 2.0)


def rows(name: str, result: Result) -> list[tuple[str, ...]]:
    """Return a row for each muscle of a run."""
    found = []
    turns = [one.natural for one in result.motion.coordinates.values()]
    turn = turns[0] if turns else np.radians(result.times)
    for muscle, one in result.report["muscles"].items():
        frames = one["frames"]
        off = bend(result.lengths[muscle], turn)
        worst = {key: max(row[key] for row in frames) for key in ("misshapen_area", "dihedral_error_p95_deg")}
        steps = [row["path_steps"] for row in frames]
        why = ", ".join(reason["check"] for reason in one["verdict"]["reasons"])
        found.append(
            (
                name,
                muscle,
                one["verdict"]["verdict"],
                why,
                f"{np.percentile(off, 95):.1f}",
                f"{off.max():.1f}",
                f"{100.0 * worst['misshapen_area']:.1f}",
                f"{worst['dihedral_error_p95_deg']:.0f}",
                f"{np.median(steps):.0f} / {max(steps)}",
                f"{np.median([row['ms'] for row in frames]):.0f}",
            )
        )
    return found


def draw(results: dict[str, Result], path: Path) -> None:
    """Draw each muscle in its last frame, with its bones, on one sheet."""
    cells = [(name, result, muscle) for name, result in results.items() for muscle in result.lengths]
    columns = math.ceil(math.sqrt(len(cells)))
    shape = math.ceil(len(cells) / columns), columns
    sheet = pv.Plotter(shape=shape, off_screen=True, window_size=[SIZE * columns, SIZE * shape[0]])
    for number, (name, result, muscle) in enumerate(cells):
        sheet.subplot(*divmod(number, columns))
        last = result.frames[-1]
        surface = pv.wrap(result.muscle(muscle, frame=last))
        for _, bone in blocks_of(result.bones(frame=last)):
            sheet.add_mesh(pv.wrap(bone), color="ivory", opacity=0.4)
        sheet.add_mesh(surface, color="indianred", smooth_shading=False)
        sheet.add_text(f"{name}: {muscle}", font_size=8)
        sheet.view_yz()
        sheet.reset_camera(bounds=surface.bounds)
    sheet.screenshot(str(path))


def main() -> None:
    """Run the scenes, print the table, and write and draw where asked to."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", type=Path, metavar="SCENE.toml")
    parser.add_argument("--pictures", type=Path, metavar="FILE", help="draw all muscles in their last frame")
    parser.add_argument("--rst", type=Path, metavar="FOLDER", help="write the table there as a CSV file")
    asked = parser.parse_args()
    paths = asked.scenes or scenes()
    if not paths:
        parser.error(f"there is no scene in {data_folder().parent}; name a SCENE.toml, or set VTKMUSCLE_DATA")
    table, results = Table("battery", HEADER, []), {}
    with tempfile.TemporaryDirectory() as folder:
        for path in paths:
            name = f"{path.parent.name}, {path.stem}" if path.stem != "scene" else path.parent.name
            print(f"{name} ...", file=sys.stderr, flush=True)
            results[name] = Scene.load(path).run(out=Path(folder) / name.replace(", ", "_"), figures=False)
            table.rows += rows(name, results[name])
        if asked.pictures:
            draw(results, asked.pictures)
    print(table.text())
    if asked.rst:
        table.write(asked.rst)


if __name__ == "__main__":
    main()
