"""Make the tables of speed against accuracy: ``python benchmarks/tradeoff_page.py [--out FOLDER]``.

Runs :func:`vtkmuscle.tradeoff` on the phantom hip and, with ``VTKMUSCLE_DATA``, on the real hip, in
steps of about 10 degrees; quality and deformer are varied, then the number of fibres. Written is a table for
each scene: all muscles together, the sum of times and the largest error.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
from real_hip import data_folder

import vtkmuscle
from vtkmuscle import Scene, phantoms
from vtkmuscle.tradeoffs import ALL, ERRORS

TABLES = Path(__file__).resolve().parents[1] / "docs" / "validation" / "tradeoff_tables"
STEP = 10.0
VARIED = ({}, {"deformer": ("none",), "quality": ("balanced",), "n_fibres": (25, 50, 100, 200)})
HEADINGS = ("ms a pose", "length [mm]", "moment arm [mm]", "points [mm]", "moment arm, published [mm]")


def scenes() -> dict[str, Scene]:
    """Return the scenes by the names of their tables."""
    found = {"phantom_hip": Scene.from_phantom(phantoms.hip())}
    if (path := data_folder() / "scene.toml").is_file():
        found["lhdl_hip"] = Scene.load(path)
    return found


def coarse(scene: Scene) -> Scene:
    """Return the scene with a motion in steps of about STEP degrees."""
    (coordinate, *_) = scene.motion.coordinates.values()
    q = np.asarray(coordinate.values)
    every = max(round(STEP / max(float(np.abs(np.diff(q)).max()), 1e-9)), 1)
    return replace(scene, motion=scene.motion.part(range(0, len(q), every)), files={})


def rows(scene: Scene) -> list[list[str]]:
    """Return the rows of a scene's table."""
    found = []
    for settings in VARIED:
        whole = vtkmuscle.tradeoff(coarse(scene), **settings).table.where(muscle=ALL)
        for i, ms in enumerate(whole["ms"]):
            words = [f"``{whole['deformer'][i]}``, ``{whole['quality'][i]}``"]
            if "n_fibres" in whole:
                words.append(f"{whole['n_fibres'][i]} fibres")
            errors = [float(whole[name][i]) for name in ERRORS]
            found.append(
                [", ".join(words), f"{ms:.0f}", *("" if np.isnan(e) else f"{e:.2g}" for e in errors)]
            )
    return found


def main() -> None:
    """Write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, default=TABLES)
    parser.add_argument("--only", nargs="+", metavar="SCENE")
    asked = parser.parse_args()
    for name, scene in scenes().items():
        if asked.only is None or name in asked.only:
            with (asked.out / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
                csv.writer(file, lineterminator="\n").writerows([["settings", *HEADINGS], *rows(scene)])


if __name__ == "__main__":
    main()
