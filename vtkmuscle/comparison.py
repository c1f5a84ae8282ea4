"""Comparison of runs of other settings, sides or subjects, and of published moment arms."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.coordinates import ANGLES, Coordinate
from vtkmuscle.core.types import SAME, Floats, Ints
from vtkmuscle.core.words import quoted
from vtkmuscle.data.anatomy import side_of
from vtkmuscle.io.literature import LiteratureCurve, curves_for, label_of, literature_of, side_apart
from vtkmuscle.run import Result, Table
from vtkmuscle.run.result_data import UNNAMED
from vtkmuscle.scenes import Scene

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Columns of the table. Means are over all frames of a run. Differences are to the first run with the same
#: axis ``over``, where both have values; ``at`` is the position of the largest difference on the axis.
COLUMNS = (
    *("muscle", "quantity", "unit", "over", "run", "verdict", "mean"),
    *("difference", "difference_rms", "difference_largest", "at"),
)
_LENGTH = "length, bone to bone"


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity of a muscle over a coordinate or time: means (n,) at positions x (n,).

    ``over`` is the name and unit of the horizontal axis, ``unit`` that of the quantity. A grid of coordinates
    has frame numbers as positions, and values of the coordinates as ``poses`` (n, c).
    """

    quantity: str
    over: str
    unit: str
    x: Floats
    mean: Floats
    poses: Floats | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """The result of :func:`compare`.

    Attributes
    ----------
    curves : dict of str to dict of str to dict of str to Curve
        By muscle, quantity and run.
    literature, verdicts : dict
        Published moment arms by muscle; verdicts by muscle and run.
    """

    curves: dict[str, dict[str, dict[str, Curve]]]
    literature: dict[str, tuple[LiteratureCurve, ...]]
    verdicts: dict[tuple[str, str], str]

    @property
    def names(self) -> list[str]:
        """Names of the runs; the first is the reference."""
        return list(dict.fromkeys(name for _, name in self.verdicts))

    def __repr__(self) -> str:
        return f"Comparison of {', '.join(self.names)}: {', '.join(self.curves)}"

    def table(self) -> Table:
        """Return means and differences to the first run. A row per muscle, quantity and run.

        A muscle without a finished frame has a row without a quantity.
        """
        rows: list[tuple[object, ...]] = []
        for muscle, quantities in self.curves.items():
            for runs in quantities.values():
                first = next(iter(runs.values()))
                for name, curve in runs.items():
                    words = muscle, curve.quantity, curve.unit, curve.over, name, self.verdicts[muscle, name]
                    rows.append((*words, float(curve.mean.mean()), *difference(curve, first)))
            done = set().union(*quantities.values())
            left = [key for key in self.verdicts if key[0] == muscle and key[1] not in done]
            rows += [(muscle, "", "", "", key[1], self.verdicts[key], *(None,) * 5) for key in left]
        return Table(COLUMNS, rows)

    def figure(self) -> "Figure":
        """Return a figure of all curves. A row of panels per muscle, a panel per quantity."""
        from matplotlib import rcParams  # noqa: PLC0415 -- a table needs no figure

        from vtkmuscle.plotting.figures import draw_literature  # noqa: PLC0415
        from vtkmuscle.plotting.sheets import blank_figure  # noqa: PLC0415

        across, (width, height) = max(1, *map(len, self.curves.values())), rcParams["figure.figsize"]
        figure = blank_figure(width * across, height * len(self.curves), "constrained")
        panels = figure.subplots(len(self.curves), across, squeeze=False)
        for row, (muscle, quantities) in zip(panels, self.curves.items(), strict=True):
            for axes in row[len(quantities) :]:
                axes.set_visible(False)
            for axes, runs in zip(row, quantities.values(), strict=False):
                for name, curve in runs.items():
                    look = {"color": f"C{self.names.index(name) % 10}", "label": name}
                    apart = len(curve.x) == 1 or curve.poses is not None
                    axes.plot(curve.x, curve.mean, "." if apart else "-", **look)
                label = curve.over.partition(" [")[0]
                published = curves_for(self.literature.get(muscle, ()), coordinate=label.replace(" ", "_"))
                if curve.quantity == f"moment arm, {label}" and published:
                    draw_literature(axes, published, 1.0)
                axes.set(xlabel=fill(curve.over, 50), ylabel=f"{curve.quantity} [{curve.unit}]")
                axes.legend(fontsize="small", frameon=False)
            row[0].set_title(label_of(muscle), loc="left")
        return figure

    def write(self, folder: str | PathLike[str]) -> list[Path]:
        """Write ``comparison.csv`` and ``comparison.png`` to a folder; return both."""
        from vtkmuscle.plotting.sheets import save_sheets  # noqa: PLC0415 -- a table needs no figure

        return save_sheets(self.table(), self.figure(), Path(folder), "comparison", digits=6)


def compare(
    results: Mapping[str, Result | str | PathLike[str]] | Sequence[Result | str | PathLike[str]],
    *,
    literature: str | PathLike[str] | None = None,
) -> Comparison:
    """Compare runs and published values.

    Runs may differ in settings, sides or subjects. Muscles and coordinates are matched by name, without the
    side (``_r``, ``_left``); both sides of a single run count as two runs.

    Parameters
    ----------
    results : mapping of str to Result or path, or sequence of Result or path
        Runs by a name, or runs and folders of results, named by default. The first run is the reference.
    literature : path, optional
        Published moment arms as of :func:`vtkmuscle.io.read_literature`; by default the arms of the runs.

    Returns
    -------
    Comparison
        ``table()`` gives the differences, ``figure()`` the curves; ``write(folder)`` writes both.

    Raises
    ------
    TypeError, ValueError
        For a scene in place of a result; if no muscle is in two of the runs, or a file cannot be read.

    Examples
    --------
    >>> import vtkmuscle
    >>> scene = vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.spindle_over_hinge(), n_fibres=8)
    >>> runs = {name: scene.with_settings(quality=name).run(frames="0:2") for name in ("preview", "balanced")}
    >>> compared = vtkmuscle.compare(runs)
    >>> compared
    Comparison of preview, balanced: spindle
    >>> compared.table().where(run="balanced", quantity="fibre length")["unit"]
    array(['mm'], dtype='<U2')
    """
    runs = results if isinstance(results, Mapping) else _named(results)
    named = {name: _loaded(run) for name, run in runs.items()}
    compared = Comparison({}, {}, {})
    for name, result in named.items():
        published = result.literature
        if literature is not None:
            published = literature_of(Path(literature), result.muscle_names, [*result.motion.coordinates])
        for muscle in result.muscle_names:
            common = side_apart(muscle)
            run = f"{name}, {muscle}" if (common, name) in compared.verdicts else name  # both sides of a run
            compared.verdicts[common, run] = result.verdicts[muscle]
            quantities = compared.curves.setdefault(common, {})
            for curve in muscle_curves(result, muscle):
                key = curve.quantity
                if next(iter(quantities.get(key, {}).values()), curve).over != curve.over:
                    key += f", over {curve.over}"
                quantities.setdefault(key, {})[run] = curve
            own = curves_for(published.get(muscle, ()), muscle=muscle)
            compared.literature[common] = compared.literature.get(common) or own
    if len(compared.curves) == len(compared.verdicts) and not any(compared.literature.values()):
        listed = "; ".join(f"{name}: {', '.join(result.muscle_names)}" for name, result in named.items())
        raise InputError("", f"no muscle is in two of the runs ({listed})", "muscles match by name")
    return compared


def _loaded(run: Result | str | PathLike[str]) -> Result:
    if not (isinstance(run, str | PathLike) or hasattr(run, "all_arms")):
        raise TypeError(f"compare takes results or their folders, not {quoted(run)}; run a scene first")
    return Result.load(run) if isinstance(run, str | PathLike) else run


def _named(results: Sequence[Result | str | PathLike[str]]) -> dict[str, Result | str | PathLike[str]]:
    named: dict[str, Result | str | PathLike[str]] = {}
    for run in [results] if isinstance(results, Result | Scene | str | PathLike) else results:
        name = run.name if isinstance(run, Result) else Path(str(run)).resolve().name
        number = sum(other == name or other.startswith(f"{name} (") for other in named)
        named[f"{name} ({number + 1})" if number else name] = run
    return named


def muscle_curves(result: Result, muscle: str) -> list[Curve]:
    """Return the curves of a muscle of a run: lengths of paths and fibres, and moment arms.

    Moment arms are over their coordinate if it fixes the pose, else over the axis of lengths: over the time,
    the only coordinate of a sweep, or, for a grid, over poses. Angles are in degrees, translations in mm.
    """
    every, crossed, frames = result.motion.coordinates, result.crosses.get(muscle), np.asarray(result.frames)
    own = {name: q for name, q in every.items() if q.changes and (crossed is None or name in crossed)}
    times, poses = np.asarray(result.times, dtype=np.float64), None
    arms = result.all_arms.get(muscle, {})
    named = {name: _matched(name, muscle, own.keys() | arms) for name in every}
    axes = {name: _axis(named[name], q, frames) for name, q in every.items()}
    over = result.time_label.removeprefix("right ").removeprefix("left ")
    steps = np.abs(np.diff([q.values for q in every.values() if q.changes])) > SAME
    if len(own) == 1 and len(set(np.sign(np.diff(axes[only := next(iter(own))][1])))) == 1:  # of a sweep
        over, times = axes[only]
    elif over in UNNAMED and own and len(steps) > 1 and (steps.sum(axis=0) <= 1).all():  # of a grid
        over = f"poses of {', '.join(label_of(named[name]) for name in own)}"
        times, poses = frames.astype(np.float64), np.column_stack([axes[name][1] for name in own])
    curves = []
    for quantity, lengths in ((_LENGTH, result.lengths), ("fibre length", result.fibre_lengths)):
        rows = lengths.get(muscle, np.empty((0, 1)))
        if len(known := np.flatnonzero(np.isfinite(rows).all(axis=1))):  # where paths come to rest
            at = times[known], rows[known], None if poses is None else poses[known]
            curves.append(_curve((quantity, over, "mm"), *at))
    for name, joint in arms.items():
        quantity, unit = f"moment arm, {label_of(named[name])}", "mm" if joint.unit in ANGLES else "1"
        label, values = axes[name]
        if own.keys() <= {name} or (poses is None and (np.diff(joint.values) > 0.0).all()):
            curves.append(_curve((quantity, label, unit), values[joint.frames], joint.arms))
        else:
            of_frames = None if poses is None else poses[joint.frames]
            curves.append(_curve((quantity, over, unit), times[joint.frames], joint.arms, of_frames))
    return curves


def _matched(name: str, muscle: str, among: Iterable[str]) -> str:
    """Return a coordinate's name, without the muscle's or the only side."""
    two = [side_apart(other) for other in among].count(side_apart(name)) > 1
    return name if two and side_of(name) != side_of(muscle) else side_apart(name)


def _axis(name: str, coordinate: Coordinate, frames: Ints) -> tuple[str, Floats]:
    """Return a coordinate's label and values, in degrees or mm."""
    unit, per_unit = ("deg", ANGLES["deg"]) if coordinate.unit in ANGLES else ("mm", 1.0)
    return label_of(name, unit), coordinate.values[frames] * (coordinate.factor / per_unit)


def difference(curve: Curve, reference: Curve) -> tuple[float | None, ...]:
    """Return figures of a curve minus a reference. Within the reference's range, or at equal poses."""
    if curve.poses is None or reference.poses is None:
        inside = (curve.x >= reference.x[0] - 1e-9) & (curve.x <= reference.x[-1] + 1e-9)
        expected = np.interp(curve.x, reference.x, reference.mean)
        if np.array_equal(curve.x, reference.x):  # also of values that repeat
            expected = reference.mean
    else:
        equal = np.all(np.abs(curve.poses[:, None] - reference.poses) <= SAME, axis=2)
        inside, expected = np.any(equal, axis=1), reference.mean[np.argmax(equal, axis=1)]
    if curve is reference or not inside.any():
        return (None,) * 4
    x, apart = curve.x[inside], (curve.mean - expected)[inside]
    worst = int(np.abs(apart).argmax())
    return float(apart.mean()), float(np.sqrt(np.mean(apart**2))), float(apart[worst]), float(x[worst])


def _curve(labels: tuple[str, str, str], x: Floats, rows: Floats, poses: Floats | None = None) -> Curve:
    order = np.argsort(x, kind="stable")
    return Curve(*labels, x[order], rows[order].mean(axis=1), poses)  # frames ascend
