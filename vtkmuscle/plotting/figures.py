"""The figures of a run as matplotlib figures."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import zip_longest
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.io.literature import LiteratureCurve, curves_for, drawn_curves, label_of
from vtkmuscle.plotting import sheets, views
from vtkmuscle.plotting.studio import Studio, actors_of, colours_of, fixed_bones, strain_colours, strains_of


def plot_rest_pose(
    muscles: Mapping[str, vtkPolyData], bones: views.DrawnBones, studio: Studio, *, title: str = "",
    units: str = "mm", width: float = sheets.WIDTH,
) -> Figure:  # fmt: skip
    """Return a picture of muscles with fixed points at rest. The width on paper is in mm."""
    hiding = bones.spread()
    shown = {label_of(name): [muscle] for name, muscle in muscles.items()}
    if len(muscles) > 1:
        shown = {"all muscles": list(muscles.values()), **shown}
    panels = []
    seen = [views.clearest_view(parts, [hiding] * len(parts)) for parts in shown.values()]
    for (name, parts), view in zip(shown.items(), sheets.fitted(seen, width), strict=True):
        if len(parts) > 1:
            image = studio.picture(actors_of(parts, view), view, bones=bones)
        else:
            image = _with_fixed_points(bones, parts[0], view, studio)
        panels.append(sheets.Panel(image, name, view))
    fixed_to = np.concatenate([fixed_bones(muscle) for muscle in muscles.values()])
    handles, labels = [], []
    for i, name in enumerate(bones.by_name):
        if count := np.count_nonzero(fixed_to == i):
            colour = views.PALETTE[i % len(views.PALETTE)]
            handles.append(Line2D([], [], linestyle="", marker="o", markersize=5, color=colour))
            labels.append(f"fixed to {name} ({count} points)")
    columns = sheets.legend_columns(width / sheets.INCH, labels)
    legend_high = 1.8 * rcParams["font.size"] / 72.0 * math.ceil(len(labels) / columns)
    figure = sheets.sheet(panels, title, units, width, bottom=0.2 + legend_high)
    figure.legend(handles, labels, loc="lower center", ncols=columns, frameon=False)
    return figure


def plot_muscle(
    frames: Sequence[views.MuscleFrame], bones: views.DrawnBones, studio: Studio, *,
    rest_fibres: vtkPolyData | None = None, title: str = "", units: str = "mm", width: float = sheets.WIDTH,
) -> Figure:  # fmt: skip
    """Return a picture of a muscle in several frames, coloured by strain since ``rest_fibres``."""
    hiding = [bones.spread(frame.transforms) for frame in frames]
    view = views.clearest_view([frame.muscle for frame in frames], hiding)
    (view, *_) = sheets.fitted([view] * len(frames), width)
    strains: list[Floats] = []
    limit, fibres = 1.0, [frame.fibres for frame in frames if frame.fibres is not None]
    if rest_fibres is not None:
        rest, *every = (polylines_of(data, "plotting: fibres").lengths for data in (rest_fibres, *fibres))
        strains, limit = strains_of(rest, every)
    panels = []
    for frame, strain in zip_longest(frames, strains):
        colours = None if strain is None else strain_colours(strain, limit)
        actors = actors_of([frame.muscle], view, fibres=frame.fibres, colours=colours, finer=studio.finer)
        image = studio.picture(actors, view, bones=bones, transforms=frame.transforms)
        panels.append(sheets.Panel(image, frame.label, view))
    figure = sheets.sheet(panels, title, units, width, bottom=0.55)
    if strains:
        bar = figure.add_axes((0.3, 0.24 / figure.get_figheight(), 0.4, 0.08 / figure.get_figheight()))
        scale = ScalarMappable(Normalize(-limit, limit), views.FIBRE_MAP)
        figure.colorbar(scale, cax=bar, orientation="horizontal", extend="both")
        bar.set_title("change of fibre length since rest [%]", fontsize="medium", pad=3.0)
    return figure


def plot_lengths(
    times: ArrayLike,
    lengths: ArrayLike,
    *,
    of: str = "path",
    title: str = "",
    time_label: str = "time",
    ticks: Mapping[float, str] | None = None,
    width: float = sheets.WIDTH,
) -> Figure:
    """Return curves of path or fibre lengths over time.

    Parameters
    ----------
    times : (k,) array_like
        Pipeline times.
    lengths : (k, n) array_like
        Lengths of n paths or fibres [mm].
    of : str, optional
        ``"path"`` or ``"fibre"``.
    title, time_label : str, optional
        Title, and label of the times.
    ticks : mapping of float to str, optional
        Words for times, such as the values of several coordinates.
    width : float, optional
        Of the figure on paper [mm].
    """
    values = np.asarray(lengths, dtype=np.float64)
    wide = width / sheets.INCH
    figure = sheets.blank_figure(wide, min(0.75 * wide, 4.2), "constrained", title=title)
    axes = figure.subplots()
    axes.set(xlabel=time_label, ylabel=f"{of} length [mm]")
    axes.spines[["top", "right"]].set_visible(False)
    if ticks:
        axes.set_xticks(list(ticks), list(ticks.values()))
    _draw_lines(axes, np.asarray(times), values, views.MUSCLE_RED, 0.25)
    label = f"{values.shape[1]} {of}{'s' * (values.shape[1] > 1)}"
    axes.plot([], [], color=views.MUSCLE_RED, linewidth=0.7, alpha=0.5, label=label)
    mean, single = values.mean(axis=1), "o" * (len(values) == 1)
    axes.plot(times, mean, color="black", linewidth=1.5, marker=single, label="mean")
    axes.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
    return figure


def _with_fixed_points(
    bones: views.DrawnBones, muscle: vtkPolyData, view: views.View, studio: Studio
) -> NDArray[np.uint8]:
    """Return a picture with the fixed points, also through bones."""
    actors = actors_of([muscle], view, fixed_points=True, finer=studio.finer)
    image = studio.picture(actors, view, bones=bones)
    points = studio.picture(actors[:-1], view)
    seen = np.ptp(points, axis=2) > 60  # the white background is grey at the rims of points
    return np.where(seen[..., None], image // 2 + points // 2, image)


def _draw_lines(axes: Axes, x: Floats, values: Floats, colours: Any, alpha: float) -> None:
    """Draw thin lines (n, k) over x (n,). Dots over a single x."""
    if len(x) == 1:
        axes.scatter(np.repeat(x, values.shape[1]), values, s=9.0, color=colours, alpha=alpha)
        return
    points = np.stack([np.broadcast_to(x[:, None], values.shape), values], axis=2)
    lines = list(points.swapaxes(0, 1))
    axes.add_collection(LineCollection(lines, linewidths=0.7, colors=colours, alpha=alpha))


def plot_moment_arms(
    arms: Mapping[str, JointArms],
    bones: views.DrawnBones | None = None,
    studio: Studio | None = None,
    *,
    rest: views.MuscleFrame | None = None,
    literature: Sequence[LiteratureCurve] = (),
    units: str = "mm",
    width: float = sheets.WIDTH,
) -> Figure:
    """Return curves of a muscle's moment arms by coordinate.

    With fibres, a path has the colour of its fibre's position across the muscle, explained by a picture of
    the muscle.

    Parameters
    ----------
    arms : mapping of str to JointArms
        By coordinate, at least 1.
    bones : DrawnBones, optional
        At rest; for the picture of the muscle.
    studio : Studio, optional
        Renders the picture of the muscle.
    rest : views.MuscleFrame, optional
        The muscle at rest, with a fibre per path, and a title.
    literature : sequence of LiteratureCurve, optional
        Published moment arms of the muscle, by coordinates of the same names.
    units : str, optional
        Unit of the scale bar.
    width : float, optional
        Of the figure on paper [mm]. The picture is beside the curves, or above them where they are narrow.
    """
    panel, wide, at_side = None, width / sheets.INCH, width > 0.6 * sheets.WIDTH
    positions = None if rest is None or rest.fibres is None else positions_across(rest.fibres)
    if rest is not None and positions is not None and bones is not None and studio is not None:
        view = views.clearest_view([rest.muscle], [bones.spread()])
        across = min(sheets.INCHES["picture"] * view.aspect, (0.33 if at_side else 0.9) * wide)
        view = replace(view, area=(across * sheets.DOTS_PER_INCH) ** 2 / view.aspect)  # pixel for pixel
        colours = colours_of(positions, views.PLACE_MAP)
        actors = actors_of([rest.muscle], view, fibres=rest.fibres, colours=colours, finer=studio.finer)
        panel = sheets.Panel(studio.picture(actors, view, bones=bones), "fibres at rest", view)
    across, high = (0.0, 0.0) if panel is None else panel.inches
    left, above = (1.05 * across, 0.0) if at_side else (0.0, 1.1 * high)
    curves_high, title = sheets.INCHES["curves"] * len(arms), rest.label if rest is not None else ""
    height = curves_high + above + (0.25 if title else 0.0)
    figure = sheets.blank_figure(wide, height, title=title)
    figure.set_layout_engine("constrained", rect=(left / wide, 0.0, 1.0 - left / wide, curves_high / height))
    if panel is not None:
        corner = (0.05, curves_high - high - 0.05) if at_side else ((wide - across) / 2.0, curves_high)
        panel.add_to(figure, corner, units)
    panels = figure.subplots(len(arms), squeeze=False)[:, 0]
    for axes, (name, joint_arms) in zip(panels, arms.items(), strict=True):
        _draw_arms(axes, joint_arms, positions)
        unit = ANGLES.get(joint_arms.unit)
        if unit is not None:
            draw_literature(axes, curves_for(literature, coordinate=name), math.pi / 180.0 / unit)
        axes.axhline(0.0, color="0.7", linewidth=0.6, zorder=0)
        axes.spines[["top", "right"]].set_visible(False)
        positive = f", positive: {joint_arms.positive}" if joint_arms.positive else ""
        label, room = label_of(name, joint_arms.unit) + positive, wide - left - 0.5
        axes.set_xlabel(fill(label, sheets.letters_in(room), break_on_hyphens=False))
        axes.set_ylabel("moment arm [mm]" if unit is not None else "moment arm [1]")
        columns = sheets.legend_columns(room, axes.get_legend_handles_labels()[1])
        axes.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns)
    return figure


def positions_across(fibres: vtkPolyData) -> Floats:
    """Return fibre positions (n,) across the muscle, 0 to 1."""
    lines = polylines_of(fibres, "plotting: fibres")
    first, last = lines.offsets[:-1], lines.offsets[1:] - 1
    middles = lines.points[(first + last) // 2]
    along = (lines.points[last] - lines.points[first]).mean(axis=0)
    along /= max(float(np.linalg.norm(along)), 1e-12)
    spread = middles - middles.mean(axis=0)
    across = np.linalg.svd(spread - np.outer(spread @ along, along), full_matrices=False)[2][0]
    offsets = spread @ (across * np.sign(across[np.abs(across).argmax()]))
    return np.asarray((offsets - offsets.min()) / max(float(np.ptp(offsets)), 1e-12))


def _draw_arms(axes: Axes, joint_arms: JointArms, positions: Floats | None) -> None:
    # A sweep up and down repeats values: curves are drawn by ascending value. A grid has a curve per stretch.
    values, mean, arms = map(joint_arms.drawn, (joint_arms.values, joint_arms.mean, joint_arms.arms))
    colour = views.MUSCLE_RED if positions is None else "#2a788e"
    by_place = colour if positions is None else colours_of(positions, views.PLACE_MAP) / 255.0
    _draw_lines(axes, values, arms, by_place, 0.6)
    axes.plot([], [], color=colour, linewidth=0.9, label=f"{arms.shape[1]} path{'s' * (arms.shape[1] > 1)}")
    axes.plot(values, mean, color="black", linewidth=1.5, marker="o" * (len(values) == 1), label="mean")
    if joint_arms.quartic is not None:
        quartic = joint_arms.drawn(joint_arms.quartic.mean(axis=1))
        axes.plot(values, quartic, color="black", linewidth=1.2, linestyle="--", label="mean of quartic fits")
    axes.set_ylim(*shown_range(joint_arms.arms, joint_arms.mean))


def shown_range(arms: Floats, mean: Floats) -> tuple[float, float]:
    """Return axis limits for the mean and most paths."""
    low, high = np.percentile(arms, (1.0, 99.0))
    low, high = min(float(low), float(mean.min()), 0.0), max(float(high), float(mean.max()), 0.0)
    margin = 0.1 * max(high - low, 1e-9)
    return low - margin, high + margin


def draw_literature(axes: Axes, curves: Sequence[LiteratureCurve], per_degree: float) -> None:
    """Draw published curves: bands, lines, or markers for single values."""
    of_source: dict[str, str] = {}
    low, high = axes.get_ylim()
    for curve in drawn_curves(curves):
        colour = of_source.setdefault(curve.source, views.PALETTE[len(of_source) % len(views.PALETTE)])
        angles, top = curve.angles * per_degree, curve.arms if curve.upper is None else curve.upper
        look: dict[str, Any] = {"color": colour, "label": curve.label}
        if curve.upper is not None:
            axes.fill_between(angles, curve.arms, top, alpha=0.2, linewidth=0, **look)
        elif len(angles) == 1:
            axes.plot(angles, curve.arms, linestyle="", marker="D", **look)
        else:
            axes.plot(angles, curve.arms, linewidth=1.5, **look)
        low, high = min(low, float(curve.arms.min())), max(high, float(top.max()))
    axes.set_ylim(low, high)
