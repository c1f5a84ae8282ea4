"""An atlas of phantom hips: many shapes of one hip, as a study, and the band of its moment arms.

``python benchmarks/atlas.py OUT --subjects 200`` writes the study of so many hips, runs it by Dask, and ranks
the causes of the band's width. Stop and start it as you
like.
"""

from __future__ import annotations

import argparse
import csv
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from vtkmuscle import Scene, SceneError
from vtkmuscle.core.machine import processors
from vtkmuscle.io.writing import write_text
from vtkmuscle.phantoms import hip
from vtkmuscle.studies.cohort import Study, run_study
from vtkmuscle.studies.cohort.table import curves, rows_of
from vtkmuscle.studies.study import PARTS, outcomes_of

#: What is varied, its mean, its standard deviation and its unit: choices, about what adults have.
VARIED = {
    "head_radius": (23.0, 2.0, "mm"),
    "neck_angle": (127.0, 5.0, "deg"),
    "muscle_volume": (1.0, 0.15, ""),
    "axis": (0.0, 4.0, "deg"),
}
#: Shapes farther from the mean than this are drawn again [standard deviations].
_FARTHEST = 2.5
#: Parts of the triangles of the phantom hip that are tried.
_DETAILS = (0.4, 0.43, 0.46, 0.5)

STUDY = """name = "atlas"
subjects = "subjects.csv"
scene = "{folder}/scene.toml"
"""


def shapes(count: int) -> list[dict[str, float]]:
    """Return so many shapes, the same each time; more of them begin with the same ones."""
    rng = np.random.default_rng(20261122)
    found = []
    while len(found) < count:
        drawn = rng.normal(size=len(VARIED))
        if np.abs(drawn).max() <= _FARTHEST:
            found.append(
                {
                    name: float(round(mean + one * sd, 4))
                    for one, (name, (mean, sd, _)) in zip(drawn, VARIED.items(), strict=True)
                }
            )
    return found


def write_hip(folder: Path, shape: dict[str, float], frames: int) -> None:
    """Write the scene of a hip, where it is not there."""
    if (folder / "scene.toml").is_file():
        return
    axis = np.radians(shape["axis"])
    varied = {name: shape[name] for name in ("head_radius", "neck_angle", "muscle_volume")}
    direction = -np.cos(axis), -np.sin(axis), 0.0
    for detail in _DETAILS:  # decimation leaves an edge with three triangles now and then
        phantom = hip(axis=direction, angles=np.linspace(0.0, 90.0, frames), detail=detail, **varied)
        try:
            Scene.from_phantom(phantom, n_fibres=32, resolution=10).save(folder)
        except SceneError:
            continue
        return
    print(f"{folder.name}: no mesh is a closed surface; it is left to fail in the study", flush=True)


def write_study(out: Path, count: int, frames: int) -> Path:
    """Write the hips, the table of subjects and the study, and return its file."""
    out.mkdir(parents=True, exist_ok=True)
    drawn = shapes(count)
    names = [f"hip{number:03d}" for number in range(count)]
    with ProcessPoolExecutor(processors(), mp_context=get_context("spawn")) as pool:
        jobs = [
            pool.submit(write_hip, out / "hips" / name, one, frames)
            for name, one in zip(names, drawn, strict=True)
        ]
        for job in jobs:
            job.result()
    rows = [
        f"{name},hips/{name}," + ",".join(map(repr, one.values()))
        for name, one in zip(names, drawn, strict=True)
    ]
    write_text(out / "subjects.csv", "\n".join([",".join(["id", "folder", *VARIED]), *rows]) + "\n")
    write_text(out / "study.toml", STUDY)
    return out / "study.toml"


def ranked(study: Study, out: Path) -> tuple[list[list[object]], list[list[object]]]:
    """Return the band of each muscle's moment arms, and the causes of its width, the greatest first.

    Causes by linear regression over the subjects, of the moment arm at each angle on the four numbers in
    standard deviations: the mean over the angles of the slope and of its absolute value, and the part of the
    variance that each explains (they are drawn independently).
    """
    rows = {row["id"]: row for row in study.subjects}
    measured = curves(rows_of(study, outcomes_of(study.cases(), out / PARTS)))
    found: dict[str, list[tuple[str, dict[str, np.ndarray]]]] = {}
    for (subject, _, _, _, muscle, *_), curve in measured.items():
        found.setdefault(muscle, []).append((subject, curve))
    bands: list[list[object]] = []
    causes: list[list[object]] = []
    for muscle, ones in found.items():
        angles = ones[0][1]["value"]
        arms = np.array([curve["moment_arm_mm"] for _, curve in ones])
        for angle, column in zip(angles, arms.T, strict=True):
            bands.append(
                [muscle, len(ones), float(angle), *np.percentile(column, (5, 25, 50, 75, 95)).tolist()]
            )
        scores = np.array(
            [[(float(rows[s][name]) - mean) / sd for name, (mean, sd, _) in VARIED.items()] for s, _ in ones]
        )
        design = np.column_stack([np.ones(len(scores)), scores])
        slopes = np.linalg.lstsq(design, arms, rcond=None)[0]
        variance = arms.var(axis=0, ddof=1).mean()
        explained = [
            float((np.outer(scores[:, i], slopes[i + 1])).var(axis=0, ddof=1).mean() / variance)
            for i in range(len(VARIED))
        ]
        left = float((arms - design @ slopes).var(axis=0, ddof=1).mean() / variance)
        order = sorted(zip(VARIED, slopes[1:], explained, strict=True), key=lambda one: -one[2])
        causes += [
            [muscle, name, float(slope.mean()), float(np.abs(slope).mean()), part]
            for name, slope, part in order
        ]
        causes.append([muscle, "left over", "", "", left])
    return bands, causes


def main() -> None:
    """Make the atlas."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("out", type=Path)
    asked.add_argument("--subjects", type=int, default=200)
    asked.add_argument("--frames", type=int, default=16)
    asked.add_argument("--workers", type=int)
    options = asked.parse_args()
    began = time.perf_counter()
    file = write_study(options.out, options.subjects, options.frames)
    print(f"{options.subjects} hips: {time.perf_counter() - began:.0f} s")
    study, out = Study.load(file), options.out / "results"
    report = run_study(
        study, out, workers=options.workers, progress=lambda one: print(one.done, one.total, one.words)
    )
    print(report["tasks"], f"{time.perf_counter() - began:.0f} s")
    bands, causes = ranked(study, out)
    header = ["muscle", "hips", "flexion_deg", "p5", "p25", "p50", "p75", "p95"]
    for name, table in (
        ("bands", [header, *bands]),
        (
            "causes",
            [["muscle", "cause", "mean_slope_mm_per_sd", "mean_abs_slope_mm_per_sd", "part"], *causes],
        ),
    ):
        with (options.out / f"{name}.csv").open("w", newline="") as lines:
            writer = csv.writer(lines, lineterminator="\n")
            writer.writerows(
                [f"{one:.4g}" if isinstance(one, float) else one for one in row] for row in table
            )
    for row in causes:
        print(*row)


if __name__ == "__main__":
    main()
