"""Where muscles of a model of OpenSim jump, and where their moment arms change sign."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.joints.tree import JointCoordinate
from vtkmuscle.opensim.model import OsimModel, read_osim
from vtkmuscle.opensim.muscle_paths import STEP, PointPath
from vtkmuscle.report.sections import Section, shown_rows, write_page
from vtkmuscle.run.table import Table

#: Poses of a sweep, and sweeps of each coordinate: with the others at their defaults, and elsewhere in their
#: ranges, angles and slides at most so far away [rad, m].
POSES, SWEEPS = 91, 8
AWAY = {True: float(np.radians(30.0)), False: 0.02}
#: The least findings: jumps of a length and of a moment arm, and moment arms on both sides of zero [m].
JUMP, ARM_JUMP, ARM = 0.5e-3, 5e-3, 2e-3
#: How often an interval is halved: a change of a length that is left then is a jump.
HALVINGS = 16
#: Distance from a jump at which its two moment arms are taken [rad or m].
BESIDE = 1e-3
#: Width and height of a curve [pixels].
_SIZE = (220, 50)
#: Columns of a table of findings.
COLUMNS = ("muscle", "coordinate", "what", "size_mm", "at", "unit", "sweeps", "pose")
#: Kinds of findings, the worst first.
KINDS = ("length jumps", "moment arm jumps", "moment arm changes sign")

#: Lengths of muscles (f,) for values of coordinates (f,).
Lengths = Callable[[Sequence[str], Mapping[str, Floats]], dict[str, Floats]]


@dataclass(frozen=True, eq=False)
class Finding:
    """The largest fault of one kind of a muscle by a coordinate.

    ``what`` is one of :data:`KINDS`; ``size`` is the jump [m], or where the sign changes, the smaller of the
    greatest moment arms on either side; ``pose`` has the coordinates that the muscle crosses [rad or m];
    ``sweeps`` is the part of the sweeps with such a fault, ``arms`` (n,) the moment arms [m] over the worst.
    """

    muscle: str
    coordinate: str
    what: str
    size: float
    pose: dict[str, float]
    sweeps: float
    values: Floats
    arms: Floats


@dataclass(frozen=True, eq=False)
class ModelCheck:
    """The faults of a model's muscles.

    Attributes
    ----------
    model : OsimModel
        As it was read.
    findings : tuple of Finding
        The largest jumps first.
    by_opensim, not_checked : tuple of str
        Muscles that wind round surfaces: evaluated by OpenSim, or not at all where that is not installed.
    """

    model: OsimModel
    findings: tuple[Finding, ...]
    by_opensim: tuple[str, ...]
    not_checked: tuple[str, ...]

    def __str__(self) -> str:
        """Which muscles were evaluated, and by what."""
        count = len(self.model.muscles)
        own = count - len(self.by_opensim) - len(self.not_checked)
        words = f"{own} of {count} muscles evaluated here"
        if self.by_opensim:
            words += f", {len(self.by_opensim)} that wind round surfaces by OpenSim"
        if self.not_checked:
            names = ", ".join(self.not_checked)
            words += f"; not evaluated, for they wind round surfaces and OpenSim is not installed: {names}"
        return words + "."

    def table(self) -> Table:
        """Return the findings, a row each; angles in degrees, sizes in millimetres."""
        return Table(COLUMNS, map(self._row, self.findings))

    def write(self, page: Path) -> Path:
        """Write the findings as one file of HTML, and as a table beside it; return the table."""
        drawings = [(f"{one.muscle}, {one.coordinate}: {one.what}", _curve(one)) for one in self.findings]
        sections = [
            Section("Findings", str(self), shown_rows(self.table()), words=True),
            Section("Moment arms", "Over the sweep in which it is largest.", drawings=drawings),
        ]
        lead = "Where muscles jump, and where their moment arms change sign."
        write_page(page, self.model.name, "check", lead, sections)
        return self.table().to_csv(page.with_suffix(".csv"), digits=6)

    def shown(self, one: Finding) -> dict[str, float]:
        """Return the pose of a finding, angles in degrees."""
        kinds = {name: self.model.tree.coordinate(name).is_angle for name in one.pose}
        return {name: float(np.degrees(at)) if kinds[name] else at for name, at in one.pose.items()}

    def _row(self, one: Finding) -> list[Any]:
        unit = "deg" if self.model.tree.coordinate(one.coordinate).is_angle else "m"
        shown = self.shown(one)
        pose = " ".join(f"{name}={at:.5g}" for name, at in shown.items())
        size = 1000.0 * one.size
        return [one.muscle, one.coordinate, one.what, size, shown[one.coordinate], unit, one.sweeps, pose]


def check_model(path: str | PathLike[str]) -> ModelCheck:
    """Sweep every muscle of a model over the ranges of the coordinates that it crosses.

    Lengths of paths over points and of polynomials are computed here, those that wind round surfaces by
    OpenSim where it is installed.

    Parameters
    ----------
    path : path
        An .osim file.

    Returns
    -------
    ModelCheck
        Jumps of lengths and moment arms, and changes of their sign. A coordinate without a range is not
        swept.

    Raises
    ------
    FileNotFoundError, ValueError
        As :func:`~vtkmuscle.opensim.read_osim`.
    """
    model = read_osim(path)
    winding = tuple(name for name, one in model.muscles.items() if getattr(one.path, "wraps", ()))
    theirs = _opensim_lengths(Path(path)) if winding else None
    findings = list(_findings(model, [name for name in model.muscles if name not in winding], _own(model)))
    if theirs is not None:
        findings += _findings(model, winding, theirs)
    findings.sort(key=lambda one: (KINDS.index(one.what), -one.size))
    checked = () if theirs is None else winding
    return ModelCheck(model, tuple(findings), checked, winding if theirs is None else ())


def _findings(model: OsimModel, muscles: Sequence[str], lengths: Lengths) -> Iterator[Finding]:
    tree = model.tree
    crossed = {name: model.muscles[name].path.coordinates(tree) for name in muscles}
    free = [one for one in tree.coordinates if one.name in tree.free]
    random = np.random.default_rng(0)
    for swept in free:
        mine = [muscle for muscle in muscles if swept.name in crossed[muscle]]
        if swept.range is None or swept.range[0] >= swept.range[1] or not mine:
            continue
        sweep = np.linspace(*swept.range, POSES)
        others = {one.name: _others(one, random) for one in free}
        values = {one: np.repeat(column, POSES) for one, column in others.items()}
        values[swept.name] = np.tile(sweep, SWEEPS)
        found = lengths(mine, values)
        for muscle in mine:
            sweeps = _Sweeps(muscle, swept.name, lengths, others, crossed[muscle], sweep)
            yield from sweeps.findings(found[muscle].reshape(SWEEPS, POSES))


def _others(one: JointCoordinate, random: np.random.Generator) -> Floats:
    """Return the values (s,) of a coordinate that is not swept: its default, and others about it."""
    away = AWAY[one.is_angle]
    low, high = np.clip(one.range or (one.rest, one.rest), one.rest - away, one.rest + away)
    return np.append(one.rest, random.uniform(low, high, SWEEPS - 1))


@dataclass(frozen=True)
class _Sweeps:
    """A muscle in sweeps (s,) of a coordinate over values (n,), each with its values of the others (s,)."""

    muscle: str
    coordinate: str
    lengths: Lengths
    others: Mapping[str, Floats]
    crossed: Sequence[str]
    values: Floats

    def length(self, sweeps: Ints, at: Floats) -> Floats:
        """Return the lengths (k,) in sweeps (k,) at values (k,) of the coordinate."""
        values = {name: column[sweeps] for name, column in self.others.items()} | {self.coordinate: at}
        return self.lengths([self.muscle], values)[self.muscle]

    def arm(self, sweeps: Ints, at: Floats) -> Floats:
        """Return the moment arms, likewise."""
        ends = self.length(np.tile(sweeps, 2), np.concatenate([at - STEP, at + STEP])).reshape(2, -1)
        result: Floats = (ends[0] - ends[1]) / (2.0 * STEP)
        return result

    def findings(self, lengths: Floats) -> Iterator[Finding]:
        """Give the worst finding of each kind, for the lengths (s, n) in the sweeps."""
        step = self.values[1] - self.values[0]
        steps = np.diff(lengths, axis=1)
        arms, middles = -steps / step, (self.values[1:] + self.values[:-1]) / 2.0

        def worst(what: str, sizes: Floats, least: float, sweeps: Ints, at: Floats) -> Iterator[Finding]:
            real = sizes > least
            if not real.any():
                return
            sizes, sweeps, at = sizes[real], sweeps[real], at[real]
            i = int(sizes.argmax())
            pose = {name: float(self.others[name][sweeps[i]]) for name in self.crossed}
            pose[self.coordinate] = float(at[i])
            part = len(np.unique(sweeps)) / SWEEPS
            yield Finding(
                self.muscle, self.coordinate, what, float(sizes[i]), pose, part, middles, arms[sweeps[i]]
            )

        # A step that is larger than both beside it may hold a jump, and so may a change of the slope.
        bends = np.abs(np.diff(steps, axis=1))
        nearby = np.pad(bends, ((0, 0), (1, 1)))
        jumped = np.zeros(steps.shape, dtype=np.bool_)
        sweeps, places = np.nonzero(np.maximum(nearby[:, 1:], nearby[:, :-1]) > JUMP / 2.0)
        if len(sweeps):
            ends = self.values[places], self.values[places + 1]
            sizes, at = _halved(self.length, sweeps, ends, _beside(steps)[sweeps, places] / step)
            jumped[sweeps, places] = sizes > JUMP
            yield from worst(KINDS[0], sizes, JUMP, sweeps, at)
        sweeps, places = np.nonzero((bends / step > ARM_JUMP) & ~(jumped[:, 1:] | jumped[:, :-1]))
        if len(sweeps):
            ends = middles[places], middles[places + 1]
            slopes = _beside(np.diff(arms, axis=1))[sweeps, places] / step
            _, at = _halved(self.arm, sweeps, ends, slopes)
            low, high = (self.arm(sweeps, at + side) for side in (-BESIDE, BESIDE))
            # A jump of the slope is twice in the steps beside it at most; more is noise of the length.
            sizes = np.minimum(np.abs(high - low), 2.0 * bends[sweeps, places] / step)
            yield from worst(KINDS[1], sizes, ARM_JUMP, sweeps, at)
        calm = np.where(jumped, 0.0, arms)
        sizes = np.minimum(calm.max(axis=1), -calm.min(axis=1))
        sweeps = np.flatnonzero(sizes > ARM)
        if len(sweeps):
            moving = [(row != 0.0, np.sign(row)) for row in calm[sweeps]]
            at = np.array([middles[some][np.flatnonzero(np.diff(signs[some]))[0]] for some, signs in moving])
            yield from worst(KINDS[2], sizes[sweeps], ARM, sweeps, at)


def _beside(steps: Floats) -> Floats:
    """Return the mean (s, n) of the steps before and after each."""
    padded = np.pad(steps, ((0, 0), (1, 1)), mode="edge")
    return (padded[:, :-2] + padded[:, 2:]) / 2.0


def _halved(
    quantity: Callable[[Ints, Floats], Floats], sweeps: Ints, ends: tuple[Floats, Floats], slopes: Floats
) -> tuple[Floats, Floats]:
    """Return the change of a quantity that is left in intervals (k,) when they are halved, and where it is.

    Of each interval that half is kept in which the quantity changes by more than by its slope beside it.
    """
    low, high = (end.copy() for end in ends)
    first, last = quantity(sweeps, low), quantity(sweeps, high)
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        now = quantity(sweeps, middle)
        smooth = slopes * (high - low) / 2.0
        upper = np.abs(last - now - smooth) > np.abs(now - first - smooth)
        low, first = np.where(upper, middle, low), np.where(upper, now, first)
        high, last = np.where(upper, high, middle), np.where(upper, last, now)
    return np.abs(last - first), (low + high) / 2.0


def _own(model: OsimModel) -> Lengths:
    """Return the function that computes lengths here."""
    tree = model.tree
    ranges = {one.name: one.range for one in tree.coordinates}

    def lengths(muscles: Sequence[str], values: Mapping[str, Floats]) -> dict[str, Floats]:
        full = tree.completed(values)
        paths = {name: model.muscles[name].path for name in muscles}
        over_points = {name: path for name, path in paths.items() if isinstance(path, PointPath)}
        poses = tree.poses(full, {point.body for path in over_points.values() for point in path.points})
        found = {name: path.lengths_at(poses, full, full, ranges) for name, path in over_points.items()}
        return {name: path.lengths(tree, full) for name, path in paths.items() if name not in found} | found

    return lengths


def _opensim_lengths(path: Path) -> Lengths | None:
    """Return the function that asks OpenSim for lengths, None where it is not installed."""
    try:
        import opensim  # noqa: PLC0415 -- an extra
    except ImportError:
        return None
    opensim.Logger.removeFileSink()  # it would leave a log in the working folder
    opensim.Logger.setLevelString("error")
    model = opensim.Model(str(path))
    state = model.initSystem()
    coordinates = model.updCoordinateSet()

    def lengths(muscles: Sequence[str], values: Mapping[str, Floats]) -> dict[str, Floats]:
        forces = [opensim.PathActuator.safeDownCast(model.getForceSet().get(name)) for name in muscles]
        paths = [force.getPath() for force in forces]
        columns = [(coordinates.get(name), column) for name, column in values.items()]
        found = np.empty((len(next(iter(values.values()))), len(muscles)))
        for row in range(len(found)):
            for coordinate, column in columns:
                if not coordinate.getLocked(state):
                    coordinate.setValue(state, float(column[row]), False)
            model.assemble(state)
            model.realizePosition(state)
            found[row] = [one.getLength(state) for one in paths]
        return dict(zip(muscles, found.T, strict=True))

    return lengths


def _curve(one: Finding) -> str:
    """Return the moment arms over the sweep as a drawing, those of a jump left out."""
    low, high = np.percentile(one.arms, [2.0, 98.0])
    low, high = min(low, 0.0), max(high, 0.0)
    width, height = _SIZE
    x = width * (one.values - one.values[0]) / (one.values[-1] - one.values[0])
    y = height * (high - np.clip(one.arms, low, high)) / ((high - low) or 1.0)
    zero = height * high / ((high - low) or 1.0)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    return (
        f'<svg width="{width}" height="{height + 2}" viewBox="0 -1 {width} {height + 2}">'
        f'<line x1="0" x2="{width}" y1="{zero:.1f}" y2="{zero:.1f}" stroke="#bbb"/>'
        f'<polyline points="{points}" fill="none" stroke="#06c"/></svg>'
    )
