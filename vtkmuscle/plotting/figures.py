"""The figures of a run, each a file."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.data.arrays import blocks_of, points_of, polylines_of
from vtkmuscle.filters.fibre_tubes import FibreTubes
from vtkmuscle.io.literature import LiteratureCurve
from vtkmuscle.plotting.moment_arms import plot_moment_arms
from vtkmuscle.plotting.preflight import can_render
from vtkmuscle.plotting.sheets import Panel, curves, save, sheet
from vtkmuscle.plotting.surfaces import FIBRE_MAP, MUSCLE_RED, PALETTE, fixed_bones, make_plotter
from vtkmuscle.plotting.views import View, choose_view

Floats = NDArray[np.float64]


class RunResult(Protocol):
    """What :func:`write_figures` needs to know of a run (:meth:`vtkmuscle.Scene.run` returns one)."""

    name: str
    units: str
    frames: Sequence[int]
    times: Sequence[float]
    muscle_names: Sequence[str]
    lengths: Mapping[str, Floats]
    report: Mapping[str, Any]
    literature: Mapping[str, Sequence[LiteratureCurve]]
    time_label: str

    verdicts: Mapping[str, str]

    def finished(self, name: str) -> int:
        """Return how many frames a muscle has: fewer than there are times where it failed on the way."""

    def moment_arms(self) -> Mapping[str, Mapping[str, JointArms]]:
        """Return the moment arms per muscle and coordinate; asked for where the report has some."""

    def rest_bones(self) -> vtkMultiBlockDataSet:
        """Return the bones at rest."""

    def rest_muscle(self, name: str) -> vtkPolyData:
        """Return a muscle at rest, with the point array ``FixedTo``."""

    def rest_fibres(self, name: str) -> vtkPolyData | None:
        """Return the fibres of a muscle at rest, None where it has none."""

    def bones(self, i: int) -> vtkMultiBlockDataSet:
        """Return the bones of frame i."""

    def muscle(self, name: str, i: int) -> vtkPolyData:
        """Return a muscle of frame i."""

    def fibres(self, name: str, i: int) -> vtkPolyData | None:
        """Return the fibres of a muscle in frame i, None where it has none."""


def plot_rest_pose(
    path: str | Path,
    muscles: Mapping[str, vtkPolyData],
    bones: vtkMultiBlockDataSet,
    *,
    title: str = "",
    units: str = "mm",
) -> Path:
    """Write a picture of the muscles at rest, their fixed points marked by bone.

    Parameters
    ----------
    path : path-like
        A .png file.
    muscles : mapping of str to vtkPolyData
        With the point array ``FixedTo``.
    bones : vtkMultiBlockDataSet
        In the same pose.
    title : str, optional
        Above the panels.
    units : str, optional
        Of length, for the scale bars.

    Returns
    -------
    Path
        The file.
    """
    views = {name: choose_view([muscle], [bones]) for name, muscle in muscles.items()}
    panels = [
        Panel(_capture_fixed_points(bones, muscle, views[name]), name.replace("_", " "), views[name])
        for name, muscle in muscles.items()
    ]
    if len(muscles) > 1:
        overview = choose_view(list(muscles.values()), [bones] * len(muscles))
        panels.insert(0, Panel(_capture(bones, list(muscles.values()), overview), "all muscles", overview))
    figure = sheet(panels, title, units)
    fixed_to = np.concatenate([fixed_bones(muscle) for muscle in muscles.values()])
    counts = np.bincount(fixed_to + 1, minlength=bones.GetNumberOfBlocks() + 1)[1:]
    handles = [
        Line2D([], [], linestyle="", marker="o", markersize=9, color=PALETTE[i % len(PALETTE)])
        for i, _ in enumerate(blocks_of(bones))
    ]
    labels = [f"fixed to {name} ({n} points)" for (name, _), n in zip(blocks_of(bones), counts, strict=True)]
    figure.legend(handles, labels, loc="lower center", ncols=4, frameon=False, fontsize=11)
    return save(figure, path)


def plot_muscle(
    path: str | Path,
    muscles: Sequence[vtkPolyData],
    bones: Sequence[vtkMultiBlockDataSet],
    *,
    fibres: Sequence[vtkPolyData] | None = None,
    rest_fibres: vtkPolyData | None = None,
    labels: Sequence[str] = (),
    title: str = "",
    units: str = "mm",
) -> Path:
    """Write a picture of one muscle in several frames, side by side, seen from the same place.

    Parameters
    ----------
    path : path-like
        A .png file.
    muscles, bones : sequence
        The muscle and the bones of each frame.
    fibres : sequence of vtkPolyData, optional
        The fibres of each frame.
    rest_fibres : vtkPolyData, optional
        The same fibres at rest: colour then shows the change of length since rest.
    labels : sequence of str, optional
        One per frame.
    title : str, optional
        Above the panels.
    units : str, optional
        Of length, for the scale bar.

    Returns
    -------
    Path
        The file.
    """
    view = choose_view(muscles, bones)
    strains, limit = None, 1.0
    if fibres is not None and rest_fibres is not None:
        rest_lengths = np.maximum(_lengths(rest_fibres), 1e-12)
        strains = [100.0 * (_lengths(lines) / rest_lengths - 1.0) for lines in fibres]
        limit = max(limit, float(np.percentile(np.abs(strains), 98)))
    panels = []
    for i, (muscle, frame_bones) in enumerate(zip(muscles, bones, strict=True)):
        image = _capture(
            frame_bones,
            [muscle],
            view,
            fibres=None if fibres is None else fibres[i],
            strain=None if strains is None else strains[i],
            strain_limit=limit,
        )
        panels.append(Panel(image, labels[i] if labels else "", view))
    figure = sheet(panels, title, units)
    if strains is not None:
        bar = figure.add_axes((0.35, 0.45 / figure.get_figheight(), 0.3, 0.12 / figure.get_figheight()))
        scale = ScalarMappable(Normalize(-limit, limit), FIBRE_MAP)
        figure.colorbar(scale, cax=bar, orientation="horizontal", extend="both")
        bar.set_title("change of fibre length since rest [%]", fontsize=10)
    return save(figure, path)


def plot_lengths(
    path: str | Path,
    times: ArrayLike,
    lengths: ArrayLike,
    *,
    title: str = "",
    time_label: str = "time",
    units: str = "mm",
) -> Path:
    """Write the lengths of the fibres of a muscle over time: a thin line each, and their mean.

    Parameters
    ----------
    path : path-like
        A .png file.
    times : (k,) array_like
        Pipeline times.
    lengths : (k, n_fibres) array_like
        Fibre lengths.
    title, time_label, units : str, optional
        What to write on the figure.

    Returns
    -------
    Path
        The file.
    """
    values = np.asarray(lengths, dtype=np.float64)
    figure, axes = curves(title, time_label, f"fibre length [{units}]")
    marker = "o" if len(values) == 1 else ""
    axes.plot(times, values, color=MUSCLE_RED, alpha=0.25, linewidth=0.7, marker=marker, markersize=3)
    axes.plot([], [], color=MUSCLE_RED, alpha=0.5, linewidth=0.7, label=f"{values.shape[1]} fibres")
    axes.plot(times, values.mean(axis=1), color="black", linewidth=2.2, marker=marker, label="mean")
    axes.legend(frameon=False)
    return save(figure, path)


def plot_volume(
    path: str | Path,
    times: Mapping[str, ArrayLike],
    ratios: Mapping[str, ArrayLike],
    *,
    title: str = "",
    time_label: str = "time",
) -> Path:
    """Write the volume of each muscle over time, as a part of its volume at rest.

    Parameters
    ----------
    path : path-like
        A .png file.
    times, ratios : mapping of str to (k,) array_like
        Per muscle the times and V / V0.
    title, time_label : str, optional
        What to write on the figure.

    Returns
    -------
    Path
        The file.
    """
    figure, axes = curves(title, time_label, "volume / volume at rest")
    axes.axhspan(0.99, 1.01, color="0.92", zorder=0, label="within 1 %")
    errors = [0.012]
    # Lines that lie on each other are all seen: the later ones are thinner.
    widths = np.linspace(4.5, 1.5, max(len(ratios), 2))
    for (name, ratio), colour, width in zip(ratios.items(), itertools.cycle(PALETTE), widths, strict=False):
        marker = "o" if np.size(ratio) == 1 else ""
        axes.plot(
            times[name], ratio, color=colour, linewidth=width, marker=marker, label=name.replace("_", " ")
        )
        errors.append(1.1 * float(np.abs(np.asarray(ratio) - 1.0).max()))
    axes.set_ylim(1.0 - max(errors), 1.0 + max(errors))
    axes.ticklabel_format(axis="y", useOffset=False)
    axes.legend(frameon=False)
    return save(figure, path)


def write_figures(folder: str | Path, result: RunResult) -> list[Path]:
    """Write all figures of a run: the rest pose, each muscle in three frames, its fibres, the volumes.

    Parameters
    ----------
    folder : path-like
        Made where it does not exist.
    result : RunResult
        What :meth:`vtkmuscle.Scene.run` returns.

    Returns
    -------
    list of Path
        ``rest_pose.png``, per muscle ``NAME_frames.png`` and (where it has fibres) ``NAME_lengths.png``,
        ``NAME_moment_arms.png`` where the report has some, and ``volume.png``.

    Raises
    ------
    RuntimeError
        If no picture can be rendered here; nothing is written then. :func:`can_render` asks beforehand.
    """
    reason = can_render()
    if reason is not None:
        raise RuntimeError(f"no figures can be made: {reason}")
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    names, times = list(result.muscle_names), list(result.times)
    written = [
        plot_rest_pose(
            out / "rest_pose.png",
            {name: result.rest_muscle(name) for name in names},
            result.rest_bones(),
            title=f"{result.name}: fixed points at rest",
            units=result.units,
        )
    ]
    arms: Mapping[str, Mapping[str, JointArms]] = {}
    paths = result.report["model"] == "paths"
    for name in names:
        frames = _telling_frames(result, name)
        if not frames:
            continue  # it failed in the first one that is kept
        verdict = result.verdicts.get(name)
        title = name.replace("_", " ") + (f": {verdict}" if verdict else "")
        fibres = [result.fibres(name, i) for i in frames]
        present = [lines for lines in fibres if lines is not None]
        written.append(
            plot_muscle(
                out / f"{name}_frames.png",
                [_tubes(lines) for lines in present] if paths else [result.muscle(name, i) for i in frames],
                [result.bones(i) for i in frames],
                fibres=present if len(present) == len(frames) else None,
                rest_fibres=result.rest_fibres(name),
                labels=[_at(result.time_label, times[i]) for i in frames],
                title=title,
                units=result.units,
            )
        )
        if name in result.lengths:
            path, lengths = out / f"{name}_lengths.png", result.lengths[name]
            at = times[: len(lengths)]
            written.append(plot_lengths(path, at, lengths, title=title, time_label=result.time_label))
        if result.report["muscles"][name].get("moment_arms"):
            arms = arms or result.moment_arms()
            path, published = out / f"{name}_moment_arms.png", result.literature.get(name, ())
            written.append(plot_moment_arms(path, arms[name], literature=published, title=title))
    if paths:
        return written
    rows = {name: result.report["muscles"][name]["frames"] for name in names}
    written.append(
        plot_volume(
            out / "volume.png",
            {name: [row["time"] for row in table] for name, table in rows.items()},
            {name: [row["volume_ratio"] for row in table] for name, table in rows.items()},
            title=result.name,
            time_label=result.time_label,
        )
    )
    return written


def _tubes(fibres: vtkPolyData) -> vtkPolyData:
    """Return fibres as a surface, which stands for a muscle where none was deformed."""
    size = float(np.linalg.norm(np.ptp(points_of(fibres), axis=0)))
    tubes = FibreTubes(radius=0.004 * size, sides=6).apply(fibres)
    surface: vtkPolyData = tubes.triangulate()
    return surface


def _telling_frames(result: RunResult, name: str) -> list[int]:
    """Return the first frame of a muscle, its worst one or else the middle, and the last; [] without any."""
    count = result.finished(name)
    reasons = result.report["muscles"][name].get("verdict", {}).get("reasons", ())
    worst = [i for i in range(count) for reason in reasons[:1] if result.frames[i] == reason["frame"]]
    return sorted({0, *(worst or [(count - 1) // 2]), count - 1}) if count else []


def _at(label: str, time: float) -> str:
    """Return a time in words: ``time 3``, or ``hip flexion 30 deg``."""
    name, _, unit = label.partition(" [")
    return f"{name} {time:.4g} {unit.removesuffix(']')}".strip()


def _capture(
    bones: vtkMultiBlockDataSet, muscles: Sequence[vtkPolyData], view: View, **options: Any
) -> NDArray[np.uint8]:
    plotter = make_plotter(bones, muscles, view, **options)
    try:
        image: NDArray[np.uint8] = plotter.screenshot(return_img=True)
    finally:
        plotter.close()
    return image


def _capture_fixed_points(bones: vtkMultiBlockDataSet, muscle: vtkPolyData, view: View) -> NDArray[np.uint8]:
    """Return a picture with the fixed points; those behind a bone shine through it."""
    image = _capture(bones, [muscle], view, fixed_points=True)
    points = _capture(vtkMultiBlockDataSet(), [muscle], view, fixed_points=True, show_muscles=False)
    seen = np.ptp(points, axis=2, keepdims=True) > 60  # the white behind the points is grey at their rims
    mixed: NDArray[np.uint8] = np.where(seen, image // 2 + points // 2, image)
    return mixed


def _lengths(fibres: vtkPolyData) -> Floats:
    lines = polylines_of(fibres, "plotting: fibres")
    return polyline_lengths(lines.points, lines.offsets)
