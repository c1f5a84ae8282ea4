"""Speed against accuracy: a scene with many settings, in time a pose and in errors."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import root_mean_square
from vtkmuscle.core.motion.coordinates import ANGLES, MILLIMETRES
from vtkmuscle.data import toml_table
from vtkmuscle.data.arrays import points_of
from vtkmuscle.filters.deformer import PRESETS
from vtkmuscle.filters.taut_paths import PATH_PRESETS
from vtkmuscle.io.literature import curves_for, drawn_curves
from vtkmuscle.io.writing import Outputs
from vtkmuscle.run import Result, Table, frame_numbers
from vtkmuscle.scene.sense import check_sense
from vtkmuscle.scenes import Scene
from vtkmuscle.studies import Row, combinations, folder_name, run_labelled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_TABLES = toml_table("vtkmuscle", "tradeoffs.toml")
#: Settings that are tried where none are named.
TRIED: Mapping[str, Sequence[Any]] = _TABLES["tried"]

#: The limit of a deformer: the numbers of ``"accurate"``, doubled.
_FINEST_PATHS = {"paths": {"resolution": 2 * PATH_PRESETS["accurate"]["resolution"]}}
_FINEST_PBD = {"iterations": 2 * PRESETS["accurate"]["iterations"], "solved_triangles": 0}
LIMITS: Mapping[str, Any] = {"none": _FINEST_PATHS, "paths": _FINEST_PATHS, "pbd": _FINEST_PBD}

#: Parameters that a quality sets: the scene's own would defeat it.
_OF_QUALITY = {"resolution", "n_paths", "iterations", "solved_triangles"}

#: Columns of errors [mm], root mean squares over frames: of mean lengths, mean moment arms and points against
#: the limit of the deformer, and of mean moment arms against published curves of the scene.
ERRORS: Mapping[str, str] = _TABLES["errors"]

#: Name of all muscles together: the sum of times, the largest error.
ALL = "all"


@dataclass(frozen=True, eq=False)
class Tradeoff:
    """The result of :func:`tradeoff`.

    Attributes
    ----------
    table : Table
        A row per setting for all muscles together, and one per muscle: settings, ``muscle``, ``verdict``,
        ``ms`` (processor time a pose after the first [ms]), the errors :data:`ERRORS`, and ``message``. A
        missing quantity is NaN.
    settings : tuple of str
        Names of the settings.
    """

    table: Table
    settings: tuple[str, ...]

    def cheapest(self, within: float) -> dict[str, Any]:
        """Return the settings with the least time within an error [mm].

        The error is that of moment arms, or else lengths, to the deformer's limit. Error and ``verdict`` are
        of the worst muscle. A ValueError names the least error where no setting is within.
        """
        whole = self.table.where(muscle=ALL)
        arms = whole["moment_arm_rms_mm"]
        errors = np.where(np.isnan(arms), whole["length_rms_mm"], arms)
        allowed = np.flatnonzero((errors <= within) & (whole["verdict"] != "failed"))
        if not len(allowed):
            least = "none has one" if np.isnan(errors).all() else f"the least is {np.nanmin(errors):.3g} mm"
            raise InputError("within", f"no setting has an error of {within:g} mm or less; {least}")
        best = int(allowed[np.argmin(whole["ms"][allowed])])
        cheapest = {name: whole[name].tolist()[best] for name in (*self.settings, "verdict", "ms")}
        return cheapest | {"error_mm": float(errors[best])}

    def figure(self) -> "Figure":
        """Return a figure of time against errors, a point per setting."""
        from vtkmuscle.plotting.sheets import blank_figure  # noqa: PLC0415 -- a table needs no figure

        whole = self.table.where(muscle=ALL)
        shown = [name for name in ERRORS if np.isfinite(whole[name]).any()]
        figure = blank_figure(5.2 * max(len(shown), 1) + 2.0, 4.4, "constrained")
        panels = figure.subplots(1, max(len(shown), 1), squeeze=False)[0]
        for axes, name in zip(panels, shown, strict=False):
            for i, (ms, error) in enumerate(zip(whole["ms"], whole[name], strict=True)):
                label = ", ".join(str(whole[setting][i]) for setting in self.settings)
                look = {"color": f"C{i % 10}", "markersize": 9, "alpha": 0.7}
                axes.plot(ms, error, "osD^vP*"[i // 10 % 7], label=label, **look)
            most = 1.1 * np.nanmax([whole["ms"], whole[name]], axis=1)
            axes.set(xlim=(0.0, most[0]), ylim=(0.0, most[1] or 1.0))
            axes.set(xlabel="processor time a pose [ms]", ylabel=ERRORS[name])
        look = {"title": ", ".join(self.settings), "frameon": False}
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", **look)
        return figure

    def write(self, folder: str | PathLike[str]) -> list[Path]:
        """Write ``tradeoff.csv`` and ``tradeoff.png`` to a folder; return both paths."""
        from vtkmuscle.plotting.sheets import save_sheets  # noqa: PLC0415 -- a table needs no figure

        return save_sheets(self.table, self.figure(), Path(folder), "tradeoff", digits=4)


def tradeoff(
    scene: Scene | str | PathLike[str], out: str | PathLike[str] | None = None, *,
    frames: str | slice | range | int | None = None, workers: int | None = 1,
    progress: Callable[[Sequence[Row]], None] | None = None, overwrite: bool = False,
    **settings: Iterable[Any],
) -> Tradeoff:  # fmt: skip
    """Measure speed against accuracy of a scene's settings.

    All combinations are run, and the limit of each deformer: ``"accurate"`` with twice its segments of
    paths or iterations.

    Parameters
    ----------
    scene : Scene or path
    out : path, optional
        Folder for the runs, the table and the figure; finished runs in the folder are read instead of run
        again. Default: no files are kept.
    frames, progress, overwrite
        As of :func:`vtkmuscle.cohort`.
    workers : int, optional
        Number of processes; runs side by side disturb each other's times.
    **settings : iterable, or a single value
        Values as of :func:`vtkmuscle.vary`; default: :data:`TRIED`.

    Raises
    ------
    ValueError
        If a setting is unknown or a value is not allowed.

    Limitations
    -----------
    The error to the limit is that of the numbers, not of the model; published curves are means of other
    subjects.

    Examples
    --------
    >>> import vtkmuscle
    >>> scene = vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.spindle_over_hinge(), n_fibres=8)
    >>> result = vtkmuscle.tradeoff(scene, frames="0:3", deformer=["none"], quality=["preview", "accurate"])
    >>> result.cheapest(within=1.0)["deformer"]
    'none'
    """
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    frame_numbers(frames, len(scene.motion.times))  # a ValueError, not a row of each run
    check_sense(scene)
    varied, tried = tuple(settings or TRIED), combinations(settings or TRIED)
    bare = _without_own(scene)
    labelled = [(each, (bare if "quality" in varied else scene).with_settings(**each)) for each in tried]
    deformers = dict.fromkeys(values.get("deformer", scene.deformer) for values in tried)
    finest = {name: max(values[name] for values in tried) for name in varied if name == "n_fibres"}
    limits = {name: {"deformer": name, "quality": "accurate", **finest, **LIMITS[name]} for name in deformers}
    labelled += [({"limit": f"limit of {name}"}, bare.with_settings(**limits[name])) for name in limits]
    options = {"frames": frames, "overwrite": overwrite, "clock": time.process_time, "sense": False}
    with TemporaryDirectory() as temporary:
        folder = Path(temporary if out is None else out)
        outputs = Outputs.for_file(folder / "tradeoff.csv", (), overwrite=overwrite)
        outputs.check(folder / "tradeoff.png")
        table = run_labelled(labelled, folder, None, workers, progress, options)
        messages = dict(zip(table["folder"], table["message"], strict=True))
        folders = [folder / folder_name(labels) for labels, _ in labelled]
        # A run that has failed as a whole has a row without a muscle, and its folder may have another run.
        ended = {name for name, muscle in zip(table["folder"], table["muscle"], strict=True) if muscle}
        results = [Result.load(own) if own.name in ended else None for own in folders]
        at_limit = dict(zip(deformers, results[len(tried) :], strict=True))
        rows: list[list[Any]] = []
        for values, result in zip(tried, results, strict=False):
            limit = at_limit[values.get("deformer", scene.deformer)]
            measured = {name: _measured(result, limit, name) for name in scene.muscles if result is not None}
            for name, row in ({ALL: _together(measured)} | measured).items():
                rows.append([*values.values(), name, *row.values(), messages.get(folder_name(values), "")])
        measured_all = Tradeoff(Table((*varied, "muscle", "verdict", "ms", *ERRORS, "message"), rows), varied)
        if out is not None:
            with outputs:
                measured_all.write(folder)
    return measured_all


def _without_own(scene: Scene) -> Scene:
    """Return the scene without its own values of parameters."""

    def rest(own: Mapping[str, Any] | None) -> dict[str, Any]:
        return {name: value for name, value in (own or {}).items() if name not in _OF_QUALITY}

    bare = {name: replace(muscle, solver=rest(muscle.solver)) for name, muscle in scene.muscles.items()}
    return replace(scene, muscles=bare, files={}, solver=rest(scene.solver), paths=rest(scene.paths) or None)


def _measured(result: Result, limit: Result | None, name: str) -> dict[str, Any]:
    """Return verdict, time and errors of a muscle by column."""
    muscle = result.report["muscles"][name]
    frames = muscle["frames"][1:] or muscle["frames"]
    times = [row.get("ms", 0.0) + row.get("ms_fibres", 0.0) for row in frames]
    row = {"verdict": muscle["verdict"]["verdict"], "ms": float(np.median(times)) if times else np.nan}
    row |= dict.fromkeys(ERRORS, np.nan)
    arms = result.all_arms.get(name, {})
    off = [
        joint.mean[inside] - np.interp(joint.angles[inside], curve.angles, _middle(curve))
        for coordinate, joint in arms.items()
        for curve in drawn_curves(curves_for(result.literature.get(name, ()), coordinate=coordinate))
        if (inside := (joint.angles >= curve.angles[0]) & (joint.angles <= curve.angles[-1])).any()
    ]
    row["published_rms_mm"] = _rms(off)
    if limit is None or min(result.finished(name), limit.finished(name)) < len(result.frames):
        return row
    for lengths, finest in ((result.lengths, limit.lengths), (result.fibre_lengths, limit.fibre_lengths)):
        if name in lengths and name in finest:
            row["length_rms_mm"] = _rms([lengths[name].mean(axis=1) - finest[name].mean(axis=1)])
            break
    off = []
    for axis, best in limit.all_arms.get(name, {}).items():
        if axis in arms and best.unit in ANGLES:  # in the frames that have both
            _, here, there = np.intersect1d(arms[axis].frames, best.frames, return_indices=True)
            off.append(arms[axis].mean[here] - best.mean[there])
    row["moment_arm_rms_mm"] = _rms(off)
    if result.report["deformer"] != "none":
        pairs = ((points_of(run.muscle(name, time=at)) for run in (result, limit)) for at in result.times)
        off = [np.linalg.norm(points - finest_points, axis=1) for points, finest_points in pairs]
        row["surface_rms_mm"] = MILLIMETRES[result.units] * _rms(off)
    return row


def _middle(curve: Any) -> Any:
    return curve.arms if curve.upper is None else 0.5 * (curve.arms + curve.upper)


def _rms(parts: Sequence[Any]) -> float:
    """Return the root mean square of all numbers, or NaN."""
    return np.nan if (root := root_mean_square(np.concatenate([*parts, np.empty(0)]))) is None else root


def _together(muscles: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the worst verdict, the sum of times and the largest errors of muscles."""
    verdicts = [row["verdict"] for row in muscles.values()]
    worst = next((verdict for verdict in ("failed", "look", "ok") if verdict in verdicts), "failed")
    row: dict[str, Any] = {"verdict": worst, "ms": sum(row["ms"] for row in muscles.values()) or np.nan}
    return row | {name: np.fmax.reduce([np.nan, *(own[name] for own in muscles.values())]) for name in ERRORS}
