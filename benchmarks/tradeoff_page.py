"""Make the tables of speed against accuracy: ``python benchmarks/tradeoff_page.py [--out FOLDER]``.

``phantom_hip`` is of :func:`vtkmuscle.tradeoff` in steps of about 10 degrees: quality and deformer are
varied, then the numbers of paths and of fibres; all muscles together, the sum of times and the largest error.
``presets`` is of the presets on all phantoms with known answers and, with ``VTKMUSCLE_DATA``, on the muscles
of the real hip; ``paths`` of few solved paths, on these muscles in all frames.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
from how_right import Known, known_phantoms
from real_hip import data_folder

import vtkmuscle
from vtkmuscle import Scene, phantoms
from vtkmuscle.core.moment_arms.of_joints import joint_arms
from vtkmuscle.data.paths import levers_over_time, paths_of
from vtkmuscle.filters.taut_paths import PATH_PRESETS
from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.run.muscles import muscle_pipeline
from vtkmuscle.tradeoffs import ALL, ERRORS

TABLES = Path(__file__).resolve().parents[1] / "docs" / "validation" / "tradeoff_tables"
STEP = 10.0
ALONE = {"deformer": ("none",), "quality": ("balanced",)}
VARIED = ({}, ALONE | {"n_paths": (9, 16, 25, 49)}, ALONE | {"n_fibres": (25, 50, 100, 200)})
HEADINGS = ("ms a pose", "length [mm]", "moment arm [mm]", "points [mm]", "moment arm, published [mm]")


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
            counts = [name for name in ("n_paths", "n_fibres") if name in whole]
            words += [f"{whole[name][i]} {name.removeprefix('n_')}" for name in counts]
            errors = [float(whole[name][i]) for name in ERRORS]
            found.append(
                [", ".join(words), f"{ms:.0f}", *("" if np.isnan(e) else f"{e:.2g}" for e in errors)]
            )
    return found


def presets() -> Iterator[list[str]]:
    """Yield a row for each phantom with a known answer, and each muscle of the real hip."""
    cases = []
    for known in known_phantoms():
        ((name, muscle),) = known.phantom.muscles.items()
        inputs = muscle, known.phantom.bones, known.motion, known.phantom.attachments[name]
        cases.append((known.name, inputs, {}, {}, known))
    for scene in (Scene.load(path) for path in [data_folder() / "scene.toml"] if path.is_file()):
        for name, muscle in scene.muscles.items():
            inputs = muscle.surface, scene.bones_data(), coarse(scene).motion, scene.attachments_data(name)
            cases.append((name, inputs, muscle.fibres or {}, scene.fixing_of(name), None))
    for name, inputs, fibres, fixing, known in cases:
        print(name, file=sys.stderr, flush=True)
        found = {quality: of_preset(quality, inputs, fibres, fixing, known) for quality in PATH_PRESETS}
        limit, row = found["accurate"][0], [name]
        for values, ms in found.values():
            truth = "" if known is None else f"{_rms(values - known.answers[-len(values) :]):.2f}"
            row += [f"{ms:.0f}", f"{_rms(values - limit):.2f}", truth]
        yield row


def of_preset(
    quality: str, inputs: Any, fibres: Mapping[str, Any], fixing: Mapping[str, Any], known: Known | None
) -> tuple[Any, float]:
    """Return mean moment arms, or lengths, over the poses [mm], and the time a pose [ms]."""
    settings = {"n_fibres": 100, **fibres}
    pipeline = MusclePipeline(*inputs, fixing=fixing, fibres=settings, quality=quality)
    lengths, levers, times, motion = [], [], [], inputs[2]
    for time in motion.times:
        begin = thread_time()
        paths = paths_of(pipeline.metrics.update(time=float(time)).output, "fibres")
        times.append(1000.0 * (thread_time() - begin))
        lengths.append(paths.lengths)
        levers.append(paths.levers)
    if known is not None and known.quantity == "length":
        return np.mean(lengths, axis=1), float(np.median(times[1:]))
    (arms,) = joint_arms(np.array(lengths), levers_over_time(levers), motion)[0].values()
    return arms.mean, float(np.median(times[1:]))


def few_paths(counts: tuple[int, ...] = (1000, 49, 25)) -> Iterator[list[str]]:
    """Yield a row for each muscle of the real hip: times, and moment arms to those of all paths."""
    scene = Scene.load(data_folder() / "scene.toml")
    for name in scene.muscles:
        arms, times = [], []
        for count in counts:
            pipeline = muscle_pipeline(replace(scene, deformer="none", paths={"n_paths": count}), name)
            lengths, levers, taken = [], [], []
            for time in scene.motion.times:
                begin = thread_time()
                paths = paths_of(pipeline.taut_paths.update(time=float(time)).output, "paths")
                taken.append(1000.0 * (thread_time() - begin))
                lengths.append(paths.lengths)
                levers.append(paths.levers)
            (found,) = joint_arms(np.array(lengths), levers_over_time(levers), scene.motion)[0].values()
            arms.append(found.arms)
            times.append(float(np.median(taken[1:])))
        means = [_rms((other - arms[0]).mean(axis=1)) for other in arms[1:]]
        single = [_rms(other - arms[0]) for other in arms[1:]]
        yield [name, *(f"{ms:.0f}" for ms in times), *(f"{error:.2f}" for error in means + single)]


def _rms(values: Any) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def main() -> None:
    """Write the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path, default=TABLES)
    parser.add_argument("--only", nargs="+", metavar="TABLE")
    asked = parser.parse_args()
    of_presets = [f"{name}: {of}" for name in PATH_PRESETS for of in ("ms", "to accurate", "to known")]
    of_paths = [f"ms, {count}" for count in ("all paths", 49, 25)]
    of_paths += [f"{of}, {count}" for of in ("mean arm", "fibres") for count in (49, 25)]
    tables = {
        "presets": (["muscle", *of_presets], presets),
        "phantom_hip": (["settings", *HEADINGS], lambda: rows(Scene.from_phantom(phantoms.hip()))),
    }
    if (data_folder() / "scene.toml").is_file():
        tables["paths"] = ["muscle", *of_paths], few_paths
    if missing := set(asked.only or ()) - tables.keys():
        parser.error(f"there is no table {', '.join(sorted(missing))}; there are {', '.join(tables)}")
    asked.out.mkdir(parents=True, exist_ok=True)
    for name in asked.only or tables:
        head, made = tables[name]
        content = [head, *made()]
        with (asked.out / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file, lineterminator="\n").writerows(content)


if __name__ == "__main__":
    main()
