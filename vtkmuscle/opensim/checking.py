"""Jumps and sign changes of muscle lengths and moment arms."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats, Ints, Progress, quiet
from vtkmuscle.data import toml_table
from vtkmuscle.data.anatomy import side_of, stem_of
from vtkmuscle.joints.tree import HALF_STEP, JointCoordinate
from vtkmuscle.labels.draft import HUMAN, SMALLEST
from vtkmuscle.opensim.by_opensim import Lengths, opensim_lengths
from vtkmuscle.opensim.mjcf import MujocoModel, read_mjcf
from vtkmuscle.opensim.model import OsimModel, read_osim
from vtkmuscle.report.page import Section, shown_rows, svg_curve, write_sections
from vtkmuscle.run.table import Table

_LIMITS = toml_table("vtkmuscle.opensim", "checks.toml")
POSES, SWEEPS = _LIMITS["poses"], _LIMITS["sweeps"]
#: Kinds of findings, the worst first, and the smallest reported size [m].
KINDS: dict[str, float] = _LIMITS["kinds"]
JUMP, ARM_JUMP, SIGN, *LEFT_FIBRES, SIDES = KINDS
#: Columns of the table of findings.
COLUMNS = ("muscle", "coordinate", "what", "size_mm", "at", "unit", "sweeps", "pose")
#: Parts that would have been swept, but have no path.
_FORCES = ("ForceSet", "actuator", "tendon")
FIBRES_OUTSIDE = "fibres leave 0.5 to 1.6 of optimal"


@dataclass(frozen=True, eq=False)
class PathFault:
    """Largest fault of a kind, for a muscle and a coordinate.

    ``what`` is a kind in :data:`KINDS`; ``size`` the jump [m], for a change of sign the smaller of the
    largest positive and negative moment arms, for a fibre the length beyond the limit; ``pose`` the muscle's
    coordinates at the fault [degrees or m]; ``unit`` (``"deg"`` or ``"m"``) is of the coordinate; ``sweeps``
    the fraction of sweeps with a fault of the kind; ``values``, ``arms`` (n,) the coordinate and moment arms
    in the worst sweep [m; 1 by a translation, and so is the size of a fault of arms].
    """

    muscle: str
    coordinate: str
    what: str
    size: float
    pose: dict[str, float]
    unit: str
    sweeps: float
    values: Floats
    arms: Floats

    @property
    def row(self) -> list[Any]:
        """Of the table of findings."""
        words = " ".join(f"{name}={at:.5g}" for name, at in self.pose.items())
        names, at = [self.muscle, self.coordinate, self.what], self.pose[self.coordinate]
        return [*names, 1000.0 * self.size, at, self.unit, self.sweeps, words]


@dataclass(frozen=True, eq=False, repr=False)
class ModelCheck:
    """The faults of a model's muscles and ligaments, grouped by path, the largest jumps first.

    Paths that wind round surfaces are ``by_opensim``, evaluated by OpenSim, or ``not_checked`` without
    OpenSim. ``not_swept`` are coordinates that are locked or without a range, ``still`` paths that no swept
    coordinate moves. ``left`` are coordinates that a stopped check left out.
    """

    model: OsimModel
    findings: tuple[PathFault, ...]
    by_opensim: tuple[str, ...]
    not_checked: tuple[str, ...]
    not_swept: tuple[str, ...] = ()
    still: tuple[str, ...] = ()
    left: tuple[str, ...] = ()

    @property
    def evaluated(self) -> set[str]:
        """Names of the evaluated muscles and ligaments."""
        return {*self.model.paths} - {*self.not_checked, *self.still}

    def __repr__(self) -> str:
        """Return the number of paths evaluated here and by OpenSim, and the parts left out."""
        counts = [
            f"{len(paths.keys() & self.evaluated)} of {len(paths)} {kind}"
            for kind, paths in (("muscles", self.model.muscles), ("ligaments", self.model.ligaments))
            if paths or kind == "muscles"
        ]
        words = f"{' and '.join(counts)} evaluated"
        if self.by_opensim:
            words += f", {len(self.by_opensim)} with wrapping surfaces by OpenSim"
        for names, why in (
            (self.not_checked, "not evaluated (wrapping needs OpenSim)"),
            (self.still, "not evaluated (no coordinate is swept)"),
            (self.not_swept, "coordinates locked or without a range, not swept"),
            (self.left, "the check was stopped, coordinates not swept"),
            ([part for part in self.model.not_used if part.startswith(_FORCES)], "left out"),
        ):
            words += f"; {why}: {', '.join(names)}" if names else ""
        return words + "."

    def to_dict(self) -> dict[str, Any]:
        """Return findings and coverage for JSON."""
        model, left = self.model, (*self.not_checked, *self.still)
        parts = {"muscles": model.muscles, "ligaments": model.ligaments, "by_opensim": self.by_opensim}
        parts |= {"not_evaluated": left, "coordinates_not_swept": self.not_swept, "not_used": model.not_used}
        parts |= {"coordinates_left": self.left}
        lists = {name: list(names) for name, names in parts.items()}
        findings = [dict(zip(COLUMNS, f.row, strict=True)) | {"pose": f.pose} for f in self.findings]
        return {"model": model.name, **lists, "findings": findings}

    def table(self) -> Table:
        """Return the findings by row; angles in degrees, sizes in millimetres."""
        return Table(COLUMNS, [each.row for each in self.findings])

    def write(self, page: Path) -> Path:
        """Write a page and a table; return the table's path."""
        titles = (f"{each.muscle}, {each.coordinate}: {each.what}" for each in self.findings)
        drawn = (svg_curve(each.values, 1000.0 * each.arms, each.unit) for each in self.findings)
        curves = list(zip(titles, drawn, strict=True))
        sections = [
            Section("Findings", str(self), shown_rows(self.table()), words=True),
            Section("Moment arms", "Each over the sweep with its largest fault.", drawings=curves),
        ]
        lead = "Jumps of lengths and moment arms, sign changes of moment arms, and fibres out of their range."
        write_sections(page, self.model.name, "check", lead, sections)
        return self.table().to_csv(page.with_suffix(".csv"), digits=6)


def check_model(
    path: str | PathLike[str], *, progress: Progress = quiet, partial: bool = False
) -> ModelCheck:
    """Check the muscles of an .osim or MJCF (.xml) model over the crossed coordinates.

    Lengths of point paths and polynomials are computed here, lengths with wrapping surfaces by OpenSim if
    installed, lengths of MJCF by MuJoCo. The result has jumps of lengths and moment arms, and sign changes of
    moment arms. A coordinate that is locked or without a range is not swept. ``progress`` is called with the
    finished part, 0 to 1. A KeyboardInterrupt ends the check; a ``partial`` check then gives the findings of
    the swept coordinates.

    Raises
    ------
    FileNotFoundError, ValueError
        As :func:`~vtkmuscle.opensim.read_osim` and :func:`~vtkmuscle.opensim.read_mjcf`.
    """
    model = read_mjcf(path) if Path(path).suffix.lower() == ".xml" else read_osim(path)
    if not model.paths:
        raise InputError(Path(path), "the model has no muscles or ligaments", "give a model with muscles")
    wound = {} if isinstance(model, MujocoModel) else model.paths
    winding = [name for name, each in wound.items() if getattr(each.path, "wraps", ())]
    by_opensim = opensim_lengths(Path(path), model, winding) if winding else None
    swept = {each.name for each in model.tree.coordinates if _span(each)}
    crossed = {name: set(each.path.coordinates(model.tree)) for name, each in model.paths.items()}
    unswept = set().union(*crossed.values()) - swept
    plain = [name for name in crossed if name not in winding]
    longest = 1000.0 * max((float(length[0]) for length in model.lengths(plain, {}).values()), default=HUMAN)
    scale = 1.0 if longest >= SMALLEST else longest / HUMAN  # of small animals

    def lengths(muscles: Sequence[str], values: Mapping[str, Floats]) -> dict[str, Floats]:
        theirs = [name for name in muscles if name in winding]
        ours = model.lengths([name for name in muscles if name not in winding], values)
        return ours | (by_opensim(theirs, values) if by_opensim is not None and theirs else {})

    evaluated = plain if by_opensim is None else list(crossed)
    moving = {q: [name for name in evaluated if q in crossed[name]] for q in model.tree.free if q in swept}
    crossing = {q: names for q, names in moving.items() if names}
    findings, left = list[PathFault](), list(crossing)
    try:
        for faults in _findings(model, crossing, lengths, scale):
            findings += faults
            del left[:1]
            progress(1.0 - len(left) / max(len(crossing), 1))
    except KeyboardInterrupt:
        if not partial:
            raise
    findings.sort(key=_worst_first)
    worst = {each.muscle: _worst_first(each) for each in reversed(findings)}
    once = {(each.muscle, each.what): each for each in reversed(findings)}  # of a fibre one coordinate tells
    findings = [each for each in findings if "fibre" not in each.what or once[each.muscle, each.what] is each]
    findings.sort(key=lambda each: (worst[each.muscle], each.muscle, _worst_first(each)))
    theirs, not_checked = ((), tuple(winding)) if by_opensim is None else (tuple(winding), ())
    not_swept = tuple(name for name in model.tree.free if name in unswept)
    still = tuple(name for name, names in crossed.items() if not names & (swept - {*left}))
    return ModelCheck(model, tuple(findings), theirs, not_checked, not_swept, still, tuple(left))


#: The name in the package itself.
check = check_model


def _worst_first(finding: PathFault) -> tuple[int, float]:
    return [*KINDS].index(finding.what), -finding.size


def _findings(
    model: OsimModel, crossing: Mapping[str, Sequence[str]], lengths: Lengths, scale: float
) -> Iterator[list[PathFault]]:
    """Yield faults by coordinate, and those of the sides at last.

    The least reported sizes scale with the body.
    """
    tree, away = model.tree, _LIMITS["away"]
    least_of = {"deg": {what: scale * size for what, size in KINDS.items()}}
    as_far = np.radians(away["angle"]) / away["translation"]  # arms of either change lengths by as much
    least_of["m"] = least_of["deg"] | {what: as_far * KINDS[what] for what in KINDS if "arm" in what}
    sides: dict[tuple[str, str], dict[str | None, Any]] = {}
    free = [coordinate for coordinate in tree.coordinates if coordinate.name in tree.free]
    angles = {coordinate.name for coordinate in free if coordinate.is_angle}
    random = np.random.default_rng(0)
    for swept in (coordinate for coordinate in free if coordinate.name in crossing):
        faults: list[PathFault] = []
        sweep = np.linspace(*(_span(swept) or (swept.rest, swept.rest)), POSES)
        fixed = {coordinate.name: _fixed_values(coordinate, random) for coordinate in free}
        values = {name: np.repeat(column, POSES) for name, column in fixed.items()}
        values[swept.name] = np.tile(sweep, SWEEPS)
        for muscle, column in lengths(crossing[swept.name], values).items():
            table = column.reshape(SWEEPS, POSES)

            def length(sweeps: Ints, at: Floats, muscle: str = muscle) -> Floats:
                chosen = {name: start[sweeps] for name, start in fixed.items()}  # noqa: B023
                return lengths([muscle], chosen | {swept.name: at})[muscle]  # noqa: B023

            middles, arms = (sweep[1:] + sweep[:-1]) / 2.0, -np.diff(table) / (sweep[1] - sweep[0])
            unit, axis = ("deg", np.degrees(middles)) if swept.name in angles else ("m", middles)
            fibres = _fibre_faults(model.paths[muscle].parameters, sweep, table)
            if (side := side_of(muscle)) == side_of(swept.name):
                key = stem_of(muscle), stem_of(swept.name)
                sides.setdefault(key, {})[side] = muscle, swept.name, unit, axis, arms[0]
            for what, sizes, sweeps, at in chain(_faults(length, sweep, table, least_of[unit]), fibres):
                if not (real := sizes > least_of[unit][what]).any():
                    continue
                i = int(np.where(real, sizes, 0.0).argmax())
                names = model.paths[muscle].path.coordinates(tree)
                pose = {name: fixed[name][sweeps[i]] for name in names} | {swept.name: at[i]}
                pose = {name: float(np.degrees(at) if name in angles else at) for name, at in pose.items()}
                of = muscle, swept.name, what, float(sizes[i]), pose, unit, len({*sweeps[real]}) / SWEEPS
                faults.append(PathFault(*of, axis, arms[sweeps[i]]))
        yield faults
    both = (fault for pair in sides.values() for fault in _sides_apart(pair))
    yield [fault for fault in both if fault.size > least_of[fault.unit][fault.what]]


def _sides_apart(sides: Mapping[str | None, Any]) -> Iterator[PathFault]:
    """Yield the largest difference of moment arms between the sides, at rest.

    Of a side: muscle, coordinate, the coordinate's unit and values (n,), and moment arms (n,) [m].
    """
    if {"left", "right"} <= sides.keys():
        (muscle, coordinate, unit, at, arms), (*_, theirs, others) = sides["right"], sides["left"]
        shared = (at >= theirs[0]) & (at <= theirs[-1])
        off = np.where(shared, np.abs(arms - np.interp(at, theirs, others)), 0.0)
        where, size = {coordinate: float(at[off.argmax()])}, float(off.max())
        yield PathFault(muscle, coordinate, SIDES, size, where, unit, 1.0 / SWEEPS, at, arms)


def _span(coordinate: JointCoordinate) -> tuple[float, float] | None:
    """Return the range in which a coordinate moves. None if it is locked or has no range."""
    low, high = coordinate.range or (0.0, 0.0)
    return (low, high) if low < high and not coordinate.locked else None


def _fixed_values(coordinate: JointCoordinate, random: np.random.Generator) -> Floats:
    """Return a fixed coordinate's values (s,): the default, then random ones."""
    away, rest = _LIMITS["away"], coordinate.rest
    away = np.radians(away["angle"]) if coordinate.is_angle else away["translation"]
    low, high = np.clip(_span(coordinate) or (rest, rest), rest - away, rest + away)
    return np.append(rest, random.uniform(low, high, SWEEPS - 1))


def _faults(
    length: Callable[[Ints, Floats], Floats], values: Floats, lengths: Floats, least: Mapping[str, float]
) -> Iterator[tuple[str, Floats, Ints, Floats]]:
    """Yield candidates (k,) by kind: kind, sizes, sweeps, and values of the coordinate.

    ``length`` returns lengths (k,) in sweeps (k,) at values (k,); ``lengths`` (s, n) are those at the swept
    values (n,), ``least`` the smallest reported sizes.
    """
    step, away = values[1] - values[0], _LIMITS["arm_distance"]
    steps = np.diff(lengths, axis=1)
    arms, middles = -steps / step, (values[1:] + values[:-1]) / 2.0

    def arm(sweeps: Ints, at: Floats) -> Floats:
        return (length(sweeps, at - HALF_STEP) - length(sweeps, at + HALF_STEP)) / (2.0 * HALF_STEP)

    # A step larger than both neighbouring steps may contain a jump, and so may a change of slope.
    bends = np.abs(np.diff(steps, axis=1))
    nearby = np.pad(bends, ((0, 0), (1, 1)))
    jumped = np.zeros(steps.shape, dtype=np.bool_)
    sweeps, columns = np.nonzero(np.maximum(nearby[:, 1:], nearby[:, :-1]) > least[JUMP] / 2.0)
    if len(sweeps):
        ends = values[columns], values[columns + 1]
        sizes, at = _halved(length, sweeps, ends, _neighbour_mean(steps)[sweeps, columns] / step)
        jumped[sweeps, columns] = sizes > least[JUMP]
        yield JUMP, sizes, sweeps, at
    sweeps, columns = np.nonzero((bends / step > least[ARM_JUMP]) & ~(jumped[:, 1:] | jumped[:, :-1]))
    if len(sweeps):
        slopes = _neighbour_mean(np.diff(arms, axis=1))[sweeps, columns] / step
        _, at = _halved(arm, sweeps, (middles[columns], middles[columns + 1]), slopes)
        change = np.abs(arm(sweeps, at + away) - arm(sweeps, at - away))
        # A jump of the slope appears at most twice in neighbouring steps; an excess is noise.
        yield ARM_JUMP, np.minimum(change, 2.0 * bends[sweeps, columns] / step), sweeps, at
    calm = np.where(jumped, 0.0, arms)
    sizes = np.minimum(calm.max(axis=1), -calm.min(axis=1))
    sweeps = np.flatnonzero(sizes > least[SIGN])
    if len(sweeps):
        moving = [(row != 0.0, np.sign(row)) for row in calm[sweeps]]
        at = np.array([middles[some][np.flatnonzero(np.diff(signs[some]))[0]] for some, signs in moving])
        yield SIGN, sizes[sweeps], sweeps, at


def _fibre_faults(
    parameters: Mapping[str, float], values: Floats, lengths: Floats
) -> Iterator[tuple[str, Floats, Ints, Floats]]:
    """Yield candidates as of :func:`_faults` for fibres with a rigid tendon and a constant thickness.

    A path that is shorter than the slack tendon gives a negative length.
    """
    optimal, slack = (parameters.get(name, 0.0) for name in ("optimal_fiber_length", "tendon_slack_length"))
    if optimal <= 0.0 or slack <= 0.0:
        return
    along = lengths - slack
    thickness = optimal * np.sin(parameters.get("pennation_angle_at_optimal", 0.0))
    fibres = np.copysign(np.hypot(along, thickness), along)
    low, high = (part * optimal for part in _LIMITS["fibres"])
    for what, sizes in zip(LEFT_FIBRES, (fibres - high, low - fibres), strict=True):
        columns, rows = sizes.argmax(axis=1), np.arange(len(sizes))
        yield what, sizes[rows, columns], rows, values[columns]


def _neighbour_mean(steps: Floats) -> Floats:
    """Return the mean (s, n) of neighbouring steps."""
    padded = np.pad(steps, ((0, 0), (1, 1)), mode="edge")
    return (padded[:, :-2] + padded[:, 2:]) / 2.0


def _halved(
    quantity: Callable[[Ints, Floats], Floats], sweeps: Ints, ends: tuple[Floats, Floats], slopes: Floats
) -> tuple[Floats, Floats]:
    """Return the remaining change (k,) in halved intervals, with its position.

    Each halving keeps the half with the larger excess over the neighbouring slope.
    """
    low, high = (end.copy() for end in ends)
    first, last = quantity(sweeps, low), quantity(sweeps, high)
    for _ in range(16):  # a change that remains is a jump
        middle = (low + high) / 2.0
        now = quantity(sweeps, middle)
        smooth = slopes * (high - low) / 2.0
        upper = np.abs(last - now - smooth) > np.abs(now - first - smooth)
        low, first = np.where(upper, middle, low), np.where(upper, now, first)
        high, last = np.where(upper, high, middle), np.where(upper, last, now)
    return np.abs(last - first), (low + high) / 2.0
