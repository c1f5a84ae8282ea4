"""Where muscles of a model of OpenSim jump, and where their moment arms change sign."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.core.types import Floats
from vtkmuscle.opensim.model import OsimModel, read_osim
from vtkmuscle.opensim.muscle_paths import STEP, PointPath
from vtkmuscle.opensim.tree import JointCoordinate
from vtkmuscle.report.sections import Section, shown_rows, write_page
from vtkmuscle.run.table import Table

#: Poses of a sweep, and sweeps of each coordinate: with the others where they are by default, and elsewhere
#: in their ranges, angles and slides at most so far away [rad, m].
POSES, SWEEPS = 91, 8
AWAY = {True: float(np.radians(30.0)), False: 0.02}
#: Jumps of a length [m] and of a moment arm [m], and moment arms on both sides of zero [m], that are told.
JUMP, ARM_JUMP, ARM = 0.5e-3, 5e-3, 2e-3
#: A jump is what is left where the interval is halved so often.
HALVINGS = 16
#: How far beside a jump its two moment arms are taken [rad or m].
BESIDE = 1e-3
#: Width and height of a curve [pixels].
_SIZE = (220, 50)
#: What a table of findings says.
COLUMNS = ("muscle", "coordinate", "what", "size_mm", "at", "unit", "sweeps", "pose")

#: Lengths of muscles (f,) for values of coordinates (f,).
Lengths = Callable[[Sequence[str], Mapping[str, Floats]], dict[str, Floats]]


@dataclass(frozen=True, eq=False)
class Finding:
    """The largest fault of one kind of a muscle by a coordinate.

    Attributes
    ----------
    muscle, coordinate : str
        Of the model.
    what : str
        ``"length jumps"``, ``"moment arm jumps"`` or ``"moment arm changes sign"``.
    size : float
        How far [m]; where the sign changes, the smaller of the greatest moment arms on either side.
    pose : dict of str to float
        Where: of the coordinates that the muscle crosses [rad or m].
    sweeps : float
        Part of the sweeps that have it.
    values, arms : (n,) array
        Moment arms [m] over that sweep.
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
    """What was found in a model.

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

    def table(self) -> Table:
        """Return the findings, a row each; angles in degrees, sizes in millimetres."""
        return Table(COLUMNS, map(self._row, self.findings))

    def write(self, page: Path) -> Path:
        """Write the findings as one file of HTML, and as a table beside it; return the table."""
        drawings = [(f"{one.muscle}, {one.coordinate}: {one.what}", _curve(one)) for one in self.findings]
        sections = [
            Section("Findings", evaluated(self), shown_rows(self.table()), words=True),
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
    order = ("length jumps", "moment arm jumps", "moment arm changes sign")
    findings.sort(key=lambda one: (order.index(one.what), -one.size))
    checked = () if theirs is None else winding
    return ModelCheck(model, tuple(findings), checked, winding if theirs is None else ())


def _findings(model: OsimModel, muscles: Sequence[str], lengths: Lengths) -> Iterator[Finding]:
    tree = model.tree
    crossed = {name: model.muscles[name].path.coordinates(tree) for name in muscles}
    ranges = {one.name: one.range for one in tree.coordinates if one.name in tree.free}
    random = np.random.default_rng(0)
    for name, limits in ranges.items():
        mine = [muscle for muscle in muscles if name in crossed[muscle]]
        if limits is None or limits[0] >= limits[1] or not mine:
            continue
        sweep = np.linspace(*limits, POSES)
        others = {one.name: _others(one, random) for one in tree.coordinates if one.name in tree.free}
        values = {one: np.repeat(column, POSES) for one, column in others.items()}
        values[name] = np.tile(sweep, SWEEPS)
        found = lengths(mine, values)
        for muscle in mine:
            at = {one: others[one] for one in crossed[muscle]}
            alone = _Alone(muscle, name, lengths, others)
            yield from _of_muscle(alone, found[muscle].reshape(SWEEPS, POSES), sweep, at)


def _others(one: JointCoordinate, random: np.random.Generator) -> Floats:
    """Return the values (s,) of a coordinate that is not swept: its default, and others about it."""
    away = AWAY[one.is_angle]
    low, high = np.clip(one.range or (one.rest, one.rest), one.rest - away, one.rest + away)
    return np.append(one.rest, random.uniform(low, high, SWEEPS - 1))


@dataclass(frozen=True)
class _Alone:
    """A muscle in sweeps of a coordinate."""

    muscle: str
    coordinate: str
    lengths: Lengths
    others: Mapping[str, Floats]

    def length(self, sweeps: Any, at: Floats) -> Floats:
        """Return its lengths (n,) in sweeps (n,) at values (n,) of the coordinate."""
        values = {name: column[sweeps] for name, column in self.others.items()} | {self.coordinate: at}
        return self.lengths([self.muscle], values)[self.muscle]

    def arm(self, sweeps: Any, at: Floats) -> Floats:
        """Return its moment arms, likewise."""
        ends = self.length(np.tile(sweeps, 2), np.concatenate([at - STEP, at + STEP])).reshape(2, -1)
        result: Floats = (ends[0] - ends[1]) / (2.0 * STEP)
        return result

    def arm_jump(self, sweeps: Any, at: Floats) -> Floats:
        """Return by how much they differ on the two sides of values, likewise."""
        low, high = (self.arm(sweeps, at + side) for side in (-BESIDE, BESIDE))
        return np.abs(high - low)


def _of_muscle(alone: _Alone, lengths: Floats, sweep: Floats, at: Mapping[str, Floats]) -> Iterator[Finding]:
    step = sweep[1] - sweep[0]
    steps = np.diff(lengths, axis=1)
    arms, middles = -steps / step, (sweep[1:] + sweep[:-1]) / 2.0

    def finding(what: str, sizes: Floats, sweeps: Any, where: Floats) -> Finding:
        worst = int(sizes.argmax())
        pose = {name: float(column[sweeps[worst]]) for name, column in at.items()}
        pose[alone.coordinate] = float(where[worst])
        part = len(np.unique(sweeps)) / SWEEPS
        size = float(sizes[worst])
        return Finding(alone.muscle, alone.coordinate, what, size, pose, part, middles, arms[sweeps[worst]])

    # A step that is larger than both beside it may hold a jump, and so may a change of the slope.
    bends = np.abs(np.diff(steps, axis=1))
    nearby = np.pad(bends, ((0, 0), (1, 1)))
    jumped = np.zeros(steps.shape, dtype=np.bool_)
    sweeps, places = np.nonzero(np.maximum(nearby[:, 1:], nearby[:, :-1]) > JUMP / 2.0)
    if len(sweeps):
        sizes, where = _halved(
            alone.length, sweeps, (sweep[places], sweep[places + 1]), _beside(steps)[sweeps, places] / step
        )
        real = sizes > JUMP
        jumped[sweeps[real], places[real]] = True
        if real.any():
            yield finding("length jumps", sizes[real], sweeps[real], where[real])
    sweeps, places = np.nonzero(bends / step > ARM_JUMP)
    calm = ~(jumped[sweeps, places] | jumped[sweeps, places + 1])
    sweeps, places = sweeps[calm], places[calm]
    if len(sweeps):
        _, where = _halved(
            alone.arm,
            sweeps,
            (middles[places], middles[places + 1]),
            _beside(np.diff(arms, axis=1))[sweeps, places] / step,
        )
        # A jump of the slope is twice in the steps beside it at most; more is noise of the length.
        sizes = np.minimum(alone.arm_jump(sweeps, where), 2.0 * bends[sweeps, places] / step)
        real = sizes > ARM_JUMP
        if real.any():
            yield finding("moment arm jumps", sizes[real], sweeps[real], where[real])
    calm_arms = np.where(jumped, 0.0, arms)
    sizes = np.minimum(calm_arms.max(axis=1), -calm_arms.min(axis=1))
    sweeps = np.flatnonzero(sizes > ARM)
    if len(sweeps):
        signs = np.sign(calm_arms[sweeps])
        changes = [np.flatnonzero(np.diff(row[row != 0.0]))[0] for row in signs]
        where = np.array([middles[row != 0.0][i] for row, i in zip(signs, changes, strict=True)])
        yield finding("moment arm changes sign", sizes[sweeps], sweeps, where)


def _beside(steps: Floats) -> Floats:
    """Return the mean (s, n) of the steps before and after each."""
    padded = np.pad(steps, ((0, 0), (1, 1)), mode="edge")
    return (padded[:, :-2] + padded[:, 2:]) / 2.0


def _halved(
    quantity: Callable[[Any, Floats], Floats], sweeps: Any, ends: tuple[Floats, Floats], slopes: Floats
) -> tuple[Floats, Floats]:
    """Return what is left of the change of a quantity in intervals (n,) that are halved to where it is.

    Taken on is the half in which it changes by more than by its slope beside the interval.
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
    """Return what computes lengths here."""
    tree = model.tree
    ranges = {one.name: one.range for one in tree.coordinates}

    def lengths(muscles: Sequence[str], values: Mapping[str, Floats]) -> dict[str, Floats]:
        full = tree.completed(values)
        poses = tree.poses(full)
        paths = {name: model.muscles[name].path for name in muscles}
        return {
            name: path.lengths_at(poses, full, full, ranges)
            if isinstance(path, PointPath)
            else path.lengths(tree, full)
            for name, path in paths.items()
        }

    return lengths


def _opensim_lengths(path: Path) -> Lengths | None:
    """Return what asks OpenSim for lengths, None where it is not installed."""
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


def evaluated(found: ModelCheck) -> str:
    """Return which muscles were evaluated, and by what."""
    own = len(found.model.muscles) - len(found.by_opensim) - len(found.not_checked)
    words = f"{own} of {len(found.model.muscles)} muscles evaluated here"
    if found.by_opensim:
        words += f", {len(found.by_opensim)} that wind round surfaces by OpenSim"
    if found.not_checked:
        names = ", ".join(found.not_checked)
        words += f"; not evaluated, for they wind round surfaces and OpenSim is not installed: {names}"
    return words + "."


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
