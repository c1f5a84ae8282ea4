"""Speed against accuracy: a scene with many settings, each against a converged run of it.

Run as ``python benchmarks/tradeoff.py SCENE --out OUT [--only NAME ...] [--muscle NAME ...]
[--frames A:B] [--every N]``; SCENE is a scene.toml, or ``demo``, the phantom hip. The reference is the scene
with ``quality = "accurate"``, its rounds doubled until the muscles stay where they are. Each setting is a run
of the scene into a folder of OUT, which goes on from what is there. Written is ``tradeoff.csv``: a row per
setting for all muscles together, then one for each muscle.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle import InputError, Result, Scene, Table, phantoms
from vtkmuscle.data.arrays import points_of
from vtkmuscle.pipelines import QUALITIES
from vtkmuscle.run import frame_numbers
from vtkmuscle.scene.data import MILLIMETRES

#: Parameters of stages that trade speed for accuracy: a setting takes the place of them all.
TRADED = ("quality", "iterations", "resolution")
#: Values of the parameters of PathDeformer, TautPaths and the fibres, tried one at a time for ``balanced``.
SOLVER: dict[str, tuple[Any, ...]] = {"iterations": (1, 2, 3, 10, 20, 40)}
PATHS: dict[str, tuple[Any, ...]] = {"resolution": (8, 16, 24, 64)}
FIBRES: dict[str, tuple[Any, ...]] = {
    "n_fibres": (25, 400),
    "resolution": (5, 45),
    "slice_tolerance": (0.1, 5.0),
    "weight_tolerance": (0.0, 0.1, 1.0),
}
#: Rounds of the first reference; they are doubled until no muscle moves any more.
FIRST_ITERATIONS, MOST_ITERATIONS = 20, 160
#: The reference has converged when doubling its iterations moves each muscle by no more, RMS [mm].
CONVERGED = 0.05
#: Every fifth frame is compared, and the last, unless frames are chosen.
COMPARED_EVERY = 5

#: Columns: what each is, and how muscles are taken together.
MEASURES = {
    "ms_per_frame": ("processor time per step of the motion, all muscles [ms]", math.fsum),
    "fibre_ms": ("the same, to carry and measure their fibres in a frame [ms]", math.fsum),
    "fill_s": ("processor time to fill the muscles with fibres, once [s]", math.fsum),
    "rms_mm": (
        "distance to the reference, RMS over points, frames and muscles [mm]",
        lambda values: math.sqrt(np.mean(np.square(values))),
    ),
    "worst_rms_mm": ("the same of the muscle where it is greatest [mm]", max),
    "max_mm": ("greatest distance to the reference [mm]", max),
    "edge_stretch_max": ("greatest edge length / length at rest", max),
    "edge_stretch_p95": ("95th percentile of the same, worst frame", max),
    "dihedral_error_p95_deg": ("the same of dihedral angles' change [degrees]", max),
    "volume_error_pct": ("greatest |V / V0 - 1| [%]", max),
    "penetration_p95_mm": ("95th percentile of depths in bones [mm]", max),
    "penetration_max_mm": ("greatest depth of a point in a bone [mm]", max),
    "fibre_length_mm": ("error of the mean fibre length, RMS over frames, worst muscle [mm]", max),
}
#: Those that are the greatest of a frame's figures in the report.
OF_FRAMES = (
    *("edge_stretch_max", "edge_stretch_p95", "dihedral_error_p95_deg"),
    *("penetration_p95_mm", "penetration_max_mm"),
)
Figures = Mapping[str, float | None]


@dataclass(frozen=True)
class Setting:
    """A quality and parameters of the deformer and the paths, and settings of the fibres.

    ``solver`` is None for all of the scene's own.
    """

    name: str
    group: str
    solver: Mapping[str, Any] | None = None
    fibres: Mapping[str, Any] = field(default_factory=dict)
    paths: Mapping[str, Any] = field(default_factory=dict)

    def of(self, scene: Scene) -> Scene:
        """Return the scene with this setting."""
        muscles = {
            name: replace(
                one,
                solver=self._traded(one.solver),
                fibres=None if one.fibres is None else {**one.fibres, **self.fibres},
            )
            for name, one in scene.muscles.items()
        }
        quality = scene.quality if self.solver is None else self.solver.get("quality")
        solver = {**self._traded(scene.solver), **(self.solver or {})}
        solver.pop("quality", None)
        changed = {"muscles": muscles, "quality": quality, "solver": solver}
        if quality == "published":
            changed["deformer"] = "pbd"
        paths = {**self._traded(scene.paths or {}), **self.paths}
        return replace(scene, paths=paths or None, **changed)

    def _traded(self, own: Mapping[str, Any]) -> dict[str, Any]:
        return {name: one for name, one in own.items() if self.solver is None or name not in TRADED}


def grid() -> list[Setting]:
    """Return all settings: the presets, the scene as it is, and one change at a time of ``balanced``."""
    # What was published is another model, and no point on the way to this one's end.
    groups = {name: name if name == "published" else "presets" for name in QUALITIES}
    settings = [Setting(name, groups[name], {"quality": name}) for name in QUALITIES]
    settings.append(Setting("scene", "scene"))
    centre = {"quality": "balanced"}
    for name, values in SOLVER.items():
        settings += [Setting(f"{name}={value}", name, {**centre, name: value}) for value in values]
    for name, values in PATHS.items():
        group = f"paths.{name}"
        settings += [Setting(f"{group}={value}", group, centre, paths={name: value}) for value in values]
    for name, values in FIBRES.items():
        settings += [Setting(f"{name}={value}", name, centre, {name: value}) for value in values]
    return settings


def chosen(settings: Sequence[Setting], only: Sequence[str]) -> list[Setting]:
    """Return the settings whose group or beginning of the name is wanted, all where nothing is."""
    found = [one for one in settings if not only or one.group in only or one.name.startswith(tuple(only))]
    if not found:
        groups = ", ".join(dict.fromkeys(one.group for one in settings))
        raise ValueError(f"no setting is called {' or '.join(only)}; there are groups {groups}")
    return found


def trade_off(
    scene: Scene, out: Path, settings: Sequence[Setting], compared: Sequence[int] | None = None
) -> Table:
    """Run a scene with many settings, and compare each with a converged run of it.

    ``compared`` are numbers of frames: those up to the last of them are computed. Times are the processor's.
    """
    last = len(scene.motion.times) - 1
    numbers = sorted({*range(0, last + 1, COMPARED_EVERY), last}) if compared is None else sorted(compared)
    times = [float(scene.motion.times[number]) for number in numbers]
    # Without files: they are of no setting.
    whole = replace(scene, motion=scene.motion.part(range(numbers[-1] + 1)), files={})

    def result_of(setting: Setting) -> Result:
        print(setting.name, flush=True)
        options = {"figures": False, "report": False, "workers": 1, "sense": False}
        return setting.of(whole).run(out / setting.name, clock=time.process_time, **options)

    exact = converged(result_of, times)
    names = list(scene.muscles)
    rows: dict[str, list[tuple[Any, ...]]] = {name: [] for name in ("all", *names)}
    for setting in (*settings, None):
        message = ""
        found: Result | None = exact
        try:
            found = exact if setting is None else result_of(setting)
        except InputError as error:
            found, message = None, str(error)
        figures = {name: measured(found, exact, name, times) for name in names}
        group, label = ("reference",) * 2 if setting is None else (setting.group, setting.name)
        for name, row in {"all": together(figures), **figures}.items():
            rows[name].append((name, group, label, *row.values(), message))
    table = Table(("muscle", "group", "setting", *MEASURES, "message"), chain.from_iterable(rows.values()))
    table.to_csv(out / "tradeoff.csv", digits=6)
    return table


def converged(result_of: Any, times: Sequence[float]) -> Result:
    """Double the iterations of the reference until its muscles stay where they are; return the last run."""
    iterations = FIRST_ITERATIONS
    before = None
    while True:
        solver = {"quality": "accurate", "iterations": iterations}
        now: Result = result_of(Setting(f"reference={iterations}", "reference", solver))
        if before is not None:
            found = {name: measured(now, before, name, times) for name in now.muscle_names}
            if any(one["rms_mm"] is None for one in found.values()):
                raise ValueError(f"a muscle failed in the reference run: {now.verdicts}")
            moved = max(float(one["rms_mm"] or 0.0) for one in found.values())
            print(
                f"{iterations} iterations instead of {iterations // 2} move the reference by {moved:.3f} mm"
            )
            if moved <= CONVERGED or iterations >= MOST_ITERATIONS:
                return now
        before, iterations = now, 2 * iterations


def measured(result: Result | None, exact: Result, name: str, times: Sequence[float]) -> Figures:
    """Return what a setting costs and how wrong a muscle is at these times; None each where it failed."""
    if result is None or result.finished(name) < len(result.frames):
        return dict.fromkeys(MEASURES)
    millimetres = MILLIMETRES[result.units]
    report = result.report["muscles"][name]
    off = [points_of(result.muscle(name, time=at)) - points_of(exact.muscle(name, time=at)) for at in times]
    distances = millimetres * np.linalg.norm(off, axis=2)
    rms = float(np.sqrt((distances**2).mean()))
    rows = [row for row in report["frames"] if row["time"] in times]
    timed = report["frames"][1:] or report["frames"]  # the first frame makes what the others use
    found: dict[str, float | None] = {
        "ms_per_frame": trimmed_mean([row["ms"] for row in timed]),
        "fibre_ms": trimmed_mean([row.get("ms_fibres", 0.0) for row in timed]),
        "fill_s": report["seconds"].get("fibres", 0.0),
        "rms_mm": rms,
        "worst_rms_mm": rms,
        "max_mm": float(distances.max()),
        "volume_error_pct": 100.0 * max(abs(row["volume_ratio"] - 1.0) for row in rows),
        "fibre_length_mm": None,
    }
    for figure in OF_FRAMES:
        found[figure] = max((row[figure] for row in rows if row.get(figure) is not None), default=None)
    if name in result.fibre_lengths:  # there may be other fibres in the reference: mean lengths are compared
        kept = [result.times.index(at) for at in times]
        mine, theirs = (one.fibre_lengths[name][kept].mean(axis=1) for one in (result, exact))
        found["fibre_length_mm"] = float(np.sqrt(np.mean((mine - theirs) ** 2)))
    return {measure: found[measure] for measure in MEASURES}


def together(muscles: Mapping[str, Figures]) -> Figures:
    """Return the figures of all muscles together; None each where one muscle has none at all."""
    if any(set(of.values()) == {None} for of in muscles.values()):
        return dict.fromkeys(MEASURES)
    known = {one: [of[one] for of in muscles.values() if of[one] is not None] for one in MEASURES}
    return {name: taken(known[name]) if known[name] else None for name, (_, taken) in MEASURES.items()}


def trimmed_mean(values: Sequence[float]) -> float:
    """Return the mean of values without the tenth at either end: what else the machine does is in those."""
    ordered = np.sort(np.asarray(values))
    cut = len(ordered) // 10
    return float(ordered[cut : len(ordered) - cut].mean())


def main() -> None:
    """Do what the options say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", nargs="+", default=(), help="groups or beginnings of names of settings")
    parser.add_argument("--muscle", nargs="+", default=())
    parser.add_argument("--frames", help="A:B:STEP, those to compare; every fifth by default")
    parser.add_argument("--every", type=int, default=1, help="take every so manieth frame of the motion only")
    asked = parser.parse_args()
    scene = Scene.from_phantom(phantoms.hip()) if asked.scene == "demo" else Scene.load(asked.scene)
    last = len(scene.motion.times) - 1
    motion = scene.motion.part(sorted({*range(0, last + 1, asked.every), last}))
    scene = replace(scene, motion=motion)
    if asked.muscle:
        scene = scene.with_muscles(*asked.muscle)
    frames = None if asked.frames is None else frame_numbers(asked.frames, len(motion.times))
    trade_off(scene, asked.out, chosen(grid(), asked.only), frames)


if __name__ == "__main__":
    main()
