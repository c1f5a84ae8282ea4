"""The figures of a run, as matplotlib has them: ``figure.savefig(path)`` writes one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.data.drawn_bones import DrawnBones
from vtkmuscle.plotting.actors import actors_of, fixed_bones, strain_colours
from vtkmuscle.plotting.colours import FIBRE_MAP, MUSCLE_RED, PALETTE
from vtkmuscle.plotting.sheets import LEGEND_FONT, Panel, curves, legend_columns, sheet
from vtkmuscle.plotting.studio import Studio
from vtkmuscle.plotting.views import View, clearest_view


def plot_rest_pose(
    muscles: Mapping[str, vtkPolyData],
    bones: DrawnBones,
    studio: Studio,
    *,
    title: str = "",
    units: str = "mm",
) -> Figure:
    """Return a picture of the muscles at rest, their fixed points marked by bone.

    Parameters
    ----------
    muscles : mapping of str to vtkPolyData
        With the point array ``FixedTo``.
    bones : DrawnBones
        At rest, too.
    studio : Studio
        Where the pictures are taken.
    title, units : str, optional
        What to write above the panels, and at the scale bars.

    Returns
    -------
    matplotlib.figure.Figure
        To be saved by ``savefig``.
    """
    hiding = bones.spread()
    panels = []
    if len(muscles) > 1:
        overview = clearest_view(list(muscles.values()), [hiding] * len(muscles))
        actors = actors_of(list(muscles.values()), overview)
        panels.append(Panel(studio.picture(actors, overview, bones=bones), "all muscles", overview))
    for name, muscle in muscles.items():
        view = clearest_view([muscle], [hiding])
        panels.append(Panel(_with_fixed_points(bones, muscle, view, studio), name.replace("_", " "), view))
    fixed_to = np.concatenate([fixed_bones(muscle) for muscle in muscles.values()])
    counts = np.bincount(fixed_to + 1, minlength=len(bones.by_name) + 1)[1:]
    named = [(i, name) for i, name in enumerate(bones.by_name) if counts[i]]
    handles = [
        Line2D([], [], linestyle="", marker="o", markersize=9, color=PALETTE[i % len(PALETTE)])
        for i, _ in named
    ]
    labels = [f"fixed to {name} ({counts[i]} points)" for i, name in named]
    figure = sheet(panels, title, units, legend=labels)
    columns = legend_columns(figure.get_figwidth(), labels)
    figure.legend(handles, labels, loc="lower center", ncols=columns, frameon=False, fontsize=LEGEND_FONT)
    return figure


def plot_muscle(
    muscles: Sequence[vtkPolyData],
    bones: DrawnBones,
    transforms: Sequence[Mapping[str, Floats]],
    studio: Studio,
    *,
    fibres: Sequence[vtkPolyData] | None = None,
    rest_fibres: vtkPolyData | None = None,
    labels: Sequence[str] = (),
    title: str = "",
    units: str = "mm",
) -> Figure:
    """Return a picture of one muscle in several frames, side by side, seen from the same place.

    Parameters
    ----------
    muscles : sequence of vtkPolyData
        The muscle in each frame.
    bones : DrawnBones
        At rest.
    transforms : sequence of mapping of str to (4, 4) array
        In each frame, of the bones that have moved.
    studio : Studio
        Where the pictures are taken.
    fibres : sequence of vtkPolyData, optional
        The fibres of each frame.
    rest_fibres : vtkPolyData, optional
        The same fibres at rest: colour then shows the change of length since rest.
    labels : sequence of str, optional
        One per frame.
    title, units : str, optional
        As of :func:`plot_rest_pose`.

    Returns
    -------
    matplotlib.figure.Figure
        To be saved by ``savefig``.
    """
    view = clearest_view(muscles, [bones.spread(moved) for moved in transforms])
    strains, limit = None, 1.0
    if fibres is not None and rest_fibres is not None:
        rest_lengths = np.maximum(_lengths(rest_fibres), 1e-12)
        strains = [100.0 * (_lengths(lines) / rest_lengths - 1.0) for lines in fibres]
        limit = max(limit, float(np.percentile(np.abs(strains), 98)))
    panels = []
    for i, (muscle, moved) in enumerate(zip(muscles, transforms, strict=True)):
        actors = actors_of(
            [muscle],
            view,
            fibres=None if fibres is None else fibres[i],
            colours=None if strains is None else strain_colours(strains[i], limit),
        )
        image = studio.picture(actors, view, bones=bones, transforms=moved)
        panels.append(Panel(image, labels[i] if labels else "", view))
    figure = sheet(panels, title, units)
    if strains is not None:
        bar = figure.add_axes((0.35, 0.45 / figure.get_figheight(), 0.3, 0.12 / figure.get_figheight()))
        scale = ScalarMappable(Normalize(-limit, limit), FIBRE_MAP)
        figure.colorbar(scale, cax=bar, orientation="horizontal", extend="both")
        bar.set_title("change of fibre length since rest [%]", fontsize=10)
    return figure


def plot_lengths(
    times: ArrayLike,
    lengths: ArrayLike,
    *,
    of: str = "path",
    title: str = "",
    time_label: str = "time",
    units: str = "mm",
) -> Figure:
    """Return the lengths of the paths or fibres of a muscle over time: a thin line each, and their mean.

    Parameters
    ----------
    times : (k,) array_like
        Pipeline times.
    lengths : (k, n) array_like
        Lengths of n paths or fibres.
    of : str, optional
        Whose they are, ``"path"`` or ``"fibre"``.
    title, time_label, units : str, optional
        What to write on the figure.

    Returns
    -------
    matplotlib.figure.Figure
        To be saved by ``savefig``.
    """
    values = np.asarray(lengths, dtype=np.float64)
    figure, axes = curves(title, time_label, f"{of} length [{units}]")
    marker = "o" if len(values) == 1 else ""
    if marker:
        axes.plot(times, values, color=MUSCLE_RED, alpha=0.25, linewidth=0.7, marker=marker, markersize=3)
    else:
        paths = np.stack([np.broadcast_to(np.asarray(times)[:, None], values.shape), values], axis=2)
        lines = LineCollection(list(paths.swapaxes(0, 1)), colors=MUSCLE_RED, alpha=0.25, linewidths=0.7)
        axes.add_collection(lines)
    axes.plot([], [], color=MUSCLE_RED, alpha=0.5, linewidth=0.7, label=f"{values.shape[1]} {of}s")
    axes.plot(times, values.mean(axis=1), color="black", linewidth=2.2, marker=marker, label="mean")
    axes.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    return figure


def _with_fixed_points(
    bones: DrawnBones, muscle: vtkPolyData, view: View, studio: Studio
) -> NDArray[np.uint8]:
    """Return a picture with the fixed points; those behind a bone shine through it."""
    actors = actors_of([muscle], view, fixed_points=True, finer=studio.finer)
    image = studio.picture(actors, view, bones=bones)
    points = studio.picture(actors[:-1], view)
    channels = np.moveaxis(points, 2, 0)  # the least along the last axis would take thirty times as long
    low, high = reduce(np.minimum, channels), reduce(np.maximum, channels)
    seen = high > low.astype(int) + 60  # the white behind the points is grey at their rims
    mixed: NDArray[np.uint8] = np.where(seen[..., None], image // 2 + points // 2, image)
    return mixed


def _lengths(fibres: vtkPolyData) -> Floats:
    lines = polylines_of(fibres, "plotting: fibres")
    return polyline_lengths(lines.points, lines.offsets)
