"""Parts of exported muscles: fitted polynomial and point paths, and muscle properties."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from scipy.optimize import least_squares

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import ROUNDING, Bools, Floats
from vtkmuscle.joints.tree import HALF_STEP, KinematicTree
from vtkmuscle.opensim import muscle_paths as paths
from vtkmuscle.opensim.muscle_paths import Columns, Cylinder, FunctionPath, PathPoint, PointPath, powers
from vtkmuscle.opensim.osim_text import MuscleOut

#: Largest number of held-out parts of each coordinate's values: the inner parts choose the polynomial's order
#: by the errors of a fit to the remaining poses, so that the order holds between the levels of a grid.
PARTS = 5
#: Relative decrease of the held-out error that justifies a higher order, and of the error that justifies a
#: cylinder. With 0 and 0.1 the errors of ten muscles of a hip and a knee change by at most a quarter; from
#: 0.05 to 0.2 they have the same cylinders, with 0 a biceps femoris has a cylinder that changes no error.
WORTH = 0.05


def fit_length(lengths: Floats, values: Columns, arms: Columns | None = None) -> FunctionPath:
    """Fit a polynomial of coordinates to lengths (f,) and moment arms -dl/dq (f,).

    ``values`` (f,) are the coordinates [rad, or units of length]; constant coordinates are omitted. Moment
    arms are fitted by the polynomial's derivatives, weighted by half the coordinate's range: few poses of a
    grid suffice. The order is the lowest whose held-out error is within 5 % of the best. If no coordinate
    changes, or poses are too few for order 1, a ValueError is raised.
    """
    moving = {name: column for name, column in values.items() if np.ptp(column) > ROUNDING}
    if not moving:
        raise InputError("", "no coordinate changes over the poses")
    samples = np.column_stack(list(moving.values()))
    # Powers about the middle, in half ranges: high powers of plain radians are nearly dependent.
    middle, half = samples.mean(axis=0), np.ptp(samples, axis=0) / 2.0
    scaled = (samples - middle) / half
    slopes = {i: -half[i] * arms[name] for i, name in enumerate(moving) if arms and name in arms}
    targets = np.concatenate([lengths, *slopes.values()])
    masks = [np.tile(mask, 1 + len(slopes)) for mask in _held_back(samples)]
    # k values of a coordinate determine a polynomial of order k - 1, with slopes of order 2 k - 1.
    counts = [len(np.unique(column)) for column in samples.T.round(9)]
    levels = min((1 + (i in slopes)) * count for i, count in enumerate(counts))

    def rows_of(order: int) -> Floats:
        return np.vstack([paths.terms(scaled, order), *(_slopes(scaled, order, i) for i in slopes)])

    errors: dict[int, float] = {}
    for order in range(1, 7):
        if order >= levels or len(powers(samples.shape[1], order)) > min((~mask).sum() for mask in masks):
            break
        rows = rows_of(order)
        off = [rows[mask] @ _solved(rows[~mask], targets[~mask]) - targets[mask] for mask in masks]
        errors[order] = rms(np.concatenate(off))
    if not errors:
        raise InputError("", f"{len(lengths)} poses are too few for {samples.shape[1]} coordinates")
    bound = (1.0 + WORTH) * min(errors.values()) + 1e-12 * float(np.abs(lengths).max())
    order = next(order for order, error in errors.items() if error <= bound)
    coefficients = _solved(rows_of(order), targets)
    return FunctionPath(tuple(moving), order, _unscaled(coefficients, middle, half, order))


def _held_back(samples: Floats) -> list[Bools]:
    """Return the masks (f,) of held-out poses, for samples (f, d)."""
    masks = []
    for column in samples.T.round(9):
        levels = np.unique(column)
        masks += [np.isin(column, part) for part in np.array_split(levels, min(PARTS, len(levels)))[1:-1]]
    numbers = np.random.default_rng(0).permutation(len(samples)) % PARTS
    return masks or [numbers == number for number in range(PARTS) if number in numbers]


def _slopes(samples: Floats, order: int, variable: int) -> Floats:
    """Return the derivatives (f, m) of polynomial terms by a variable."""
    table = powers(samples.shape[1], order)
    factors = table[:, variable].copy()
    table[:, variable] = np.maximum(factors - 1, 0)
    return np.asarray(factors * np.prod(samples[:, None, :] ** table, axis=2))


def _solved(rows: Floats, targets: Floats) -> Floats:
    return np.asarray(np.linalg.lstsq(rows, targets, rcond=None)[0])


def rms(errors: Floats) -> float:
    """Return the root mean square."""
    return float(np.sqrt((errors**2).mean()))


def _unscaled(coefficients: Floats, middle: Floats, half: Floats, order: int) -> Floats:
    """Return coefficients for plain coordinates from coefficients for scaled coordinates."""
    table = tuple(powers(len(half), order).T)
    result = np.zeros([order + 1] * len(half))
    result[table] = coefficients
    for axis, (centre, width) in enumerate(zip(middle, half, strict=True)):
        # Columns: the powers of (q - centre) / width, multiplied out.
        factor = Polynomial([-centre / width, 1.0 / width])
        columns = [np.resize((factor**power).coef, order + 1) for power in range(order + 1)]
        result = np.moveaxis(np.tensordot(np.tril(columns), result, (0, axis)), 0, axis)
    return np.asarray(result[table])


#: Initial positions of a cylinder along its part of the line. With the middle alone the errors of ten muscles
#: of a hip and a knee are 0.18 and 1.2 mm instead of 0.14 and 0.61 (root mean square).
PLACES = (0.25, 0.5, 0.75)
#: Initial radius of a cylinder [m], of a joint; a bone's, 0.015, as well changes the errors by 0.001 mm.
RADIUS = 0.04
#: Steps of lengths [m] and of directions that the search treats as equal. A step of directions of 0.1 or 1,
#: or of lengths of 0.1, gives larger errors, by a tenth to a half.
SCALES = (0.01, 0.3)


def fit_points(
    line: Floats, tree: KinematicTree, values: Columns, ends: tuple[str, str], lengths: Floats, arms: Columns,
    *, tolerance: float,
) -> PointPath:  # fmt: skip
    """Fit a point path with cylinders to lengths and moment arms.

    The path joins the fibres' mean ends, with a via point on either side of each joint, and may wind round a
    cylinder on either body of a joint. Points and cylinders minimise the squared errors of lengths and of
    moment arms, these times half the coordinate's range. Until the error is within tolerance, the best
    cylinder is added, provided that the path stays on one side in all poses.

    ``line`` (f, n, 3) is the mean fibre in the root's frame [m], ``ends`` the bodies of origin and insertion;
    ``lengths`` (f,) and ``tolerance`` (root mean square) are in metres, ``arms`` by coordinate [m, or 1].
    """
    search = _Search(tree, values, lengths, arms)
    poses = tree.poses(values)
    shapes = {
        body: np.einsum("fji,fnj->fni", poses[body][:, :3, :3], line - poses[body][:, None, :3, 3])
        for body in _between(tree, ends)
    }
    bodies, last = list(shapes), line.shape[1] - 1
    on = [bodies[0], *(body for joint in pairwise(bodies) for body in joint), bodies[-1]]
    # A via point starts at the point of the line that moves least on the body.
    edges = np.linspace(0, last, 2 * len(on) - 1).round().astype(int)[1::2]
    spreads = {body: shape.var(axis=0).sum(axis=1) for body, shape in shapes.items()}
    inner = zip(on[1:-1], pairwise(edges), strict=True)
    at = [0, *(low + int(spreads[body][low : high + 1].argmin()) for body, (low, high) in inner), last]
    points = [PathPoint(body, shapes[body][:, i].mean(axis=0)) for body, i in zip(on, at, strict=True)]
    initial = PointPath(points)
    best = search.refined(initial)
    while search.error(best) > tolerance:
        taken = {cylinder.after for cylinder in best.cylinders}
        tried = [
            search.refined(replace(initial, cylinders=[*best.cylinders, cylinder]))
            for after in range(1, len(points) - 2, 2)
            if after not in taken
            for body in on[after : after + 2]
            for cylinder in _beginnings(shapes[body].mean(axis=0)[at[after] : at[after + 1] + 1], body, after)
        ]
        tried = [path for path in tried if not search.flips(path)]
        better = min(tried, key=search.error, default=best)
        if search.error(better) > (1.0 - WORTH) * search.error(best):
            break
        best = better
    return best


class _Search:
    """Target lengths and moment arms, and the poses of bodies there."""

    def __init__(self, tree: KinematicTree, values: Columns, lengths: Floats, arms: Columns) -> None:
        full = tree.completed(values)
        self.frames = len(lengths)
        halves = {name: np.ptp(full[name]) / 2.0 for name in arms}
        self.halves = np.array([halves[name] for name in arms])
        self.targets = np.concatenate([lengths, *(halves[name] * arm for name, arm in arms.items())])
        moves = [{}, *({name: sign * HALF_STEP} for name in arms for sign in (-1.0, 1.0))]
        moved = {q: np.concatenate([full[q] + move.get(q, 0.0) for move in moves]) for q in tree.free}
        self.at = paths.Posed.of(tree, moved)

    def off(self, path: PointPath) -> Floats:
        """Return the errors of lengths and scaled moment arms [m]."""
        lengths = path.lengths_at(self.at).reshape(-1, self.frames)
        arms = (lengths[1::2] - lengths[2::2]) / (2.0 * HALF_STEP)
        return np.asarray(np.append(lengths[0], self.halves[:, None] * arms) - self.targets)

    def error(self, path: PointPath) -> float:
        """Return the root mean square error."""
        return rms(self.off(path))

    def flips(self, path: PointPath) -> bool:
        """Return whether a path takes both sides of a cylinder: its moment arm jumps."""
        points = path.positions(self.at)
        for each in path.cylinders:
            sides = each.segments(self.at.bodies[each.body], *points[each.after : each.after + 2])[1]
            if sides.min() < 0.0 < sides.max():
                return True
        return False

    def refined(self, path: PointPath) -> PointPath:
        """Return the path with optimal via points and cylinders."""
        bodies = [point.body for point in path.points]
        first, last = path.points[0], path.points[-1]
        middle = len(bodies) - 2

        def path_of(numbers: Floats) -> PointPath:
            rows = SCALES[0] * numbers[: 3 * middle].reshape(-1, 3)
            points = [PathPoint(body, row) for body, row in zip(bodies[1:-1], rows, strict=True)]
            cylinders = []
            for each, row in zip(path.cylinders, numbers[3 * middle :].reshape(-1, 7), strict=True):
                axis = row[3:6] / np.linalg.norm(row[3:6])
                centre, radius = SCALES[0] * row[:3], SCALES[0] * abs(row[6])
                cylinders.append(Cylinder(each.body, centre, axis, radius, each.after))
            return PointPath([first, *points, last], (), cylinders)

        parts = [np.asarray(point.position) / SCALES[0] for point in path.points[1:-1]]
        for each in path.cylinders:
            parts += [each.centre / SCALES[0], each.axis / SCALES[1], np.array([each.radius / SCALES[0]])]
        initial = np.concatenate(parts)
        return path_of(least_squares(lambda x: self.off(path_of(x)) / SCALES[0], initial, max_nfev=40).x)


def _beginnings(line: Floats, body: str, after: int) -> Iterator[Cylinder]:
    """Yield initial cylinders inside the bend of a line (n, 3)."""
    chord = line[-1] - line[0]
    chord = chord / np.linalg.norm(chord)
    for part in PLACES:
        top = line[round(part * (len(line) - 1))]
        bow = top - line[0] - ((top - line[0]) @ chord) * chord
        height = np.linalg.norm(bow)
        if height > 0.0:
            yield Cylinder(body, top - RADIUS * bow / height, np.cross(chord, bow / height), RADIUS, after)


def _between(tree: KinematicTree, ends: Sequence[str]) -> list[str]:
    """Return the bodies between two bodies, ends included."""
    first, second = ([body, *(joint.parent for joint in tree.way_up(body))] for body in ends)
    common = next(body for body in first if body in second)
    return list(dict.fromkeys([*first[: first.index(common) + 1], *reversed(second[: second.index(common)])]))


#: Default force per physiological cross-section [N/cm^2]: Rajagopal et al. 2016,
#: doi:10.1109/TBME.2016.2586891.
SPECIFIC_TENSION = 60.0
#: Properties that a muscle with force requires.
NEEDED = ("max_isometric_force", "optimal_fiber_length", "tendon_slack_length")
#: Tendon of a muscle without tendon, as a part of the path; OpenSim needs a tendon. Changes of the lengths of
#: fibres and paths differ by as much (docs/reference/verdicts.rst).
SHORTEST_TENDON = 0.01


def opensim_properties(hill: Mapping[str, float], metres: float) -> dict[str, float]:
    """Return OpenSim properties for a scene's Hill parameters, ``metres`` per unit of length."""
    units = {
        "optimal_fibre_length": ("optimal_fiber_length", metres),
        "tendon_slack_length": ("tendon_slack_length", metres),
        "pennation": ("pennation_angle_at_optimal", np.pi / 180.0),
        "max_isometric_force": ("max_isometric_force", 1.0),
        "pcsa": ("max_isometric_force", hill["specific_tension"] if "pcsa" in hill else 0.0),
    }
    return {name: unit * hill[key] for key, (name, unit) in units.items() if key in hill}


def completed_properties(
    fixed: Mapping[str, float], architecture: Mapping[str, Any], name: str, length: float, share: float = 1.0,
    specific_tension: float = SPECIFIC_TENSION,
) -> dict[str, float]:  # fmt: skip
    """Return OpenSim properties of a muscle, ``fixed`` properties completed from its architecture.

    Fibre length and pennation at rest are taken as optimal, unless the sarcomere length is in the
    architecture. The tendon is slack at rest: fibres and tendon make up the path, ``length`` [m] at rest. The
    tendon is no shorter than :data:`SHORTEST_TENDON` of the path; an InputError is raised for fibres longer
    than the path by more. ``share`` is the group's mean fibre length relative to all fibres;
    ``specific_tension`` is in N/cm^2.
    """
    force = specific_tension * (architecture["pcsa_without_tendon_mm2"] / 100.0)
    properties = {"max_isometric_force": force, **fixed}
    mean = architecture["fascicle_length_mm"]["mean"]
    fibre = share * mean / 1000.0
    ends = [architecture[f"fascicle_pennation_{end}_deg"]["mean"] for end in ("origin", "insertion")]
    pennation = float(np.radians(np.mean(ends)))
    if "optimal_fiber_length" in properties:
        fibre = properties["optimal_fiber_length"]
        pennation = properties.get("pennation_angle_at_optimal", pennation)
    else:
        optimal = share * architecture.get("fascicle_length_normalised_mm", mean) / 1000.0
        properties["optimal_fiber_length"] = optimal
        inward = min(fibre * np.sin(pennation) / optimal, 0.99)
        properties.setdefault("pennation_angle_at_optimal", float(np.arcsin(inward)))
    if "tendon_slack_length" not in properties:
        tendon, least = length - fibre * float(np.cos(pennation)), SHORTEST_TENDON * length
        if tendon < -least:
            problem = f"muscle {name!r} has a path of {1000 * length:.4g} mm and fibres of "
            remedy = "give hill.optimal_fibre_length or hill.tendon_slack_length, or export geometry only"
            raise InputError("", f"{problem}{1000 * fibre:.4g} mm at rest, so no tendon", remedy)
        properties["tendon_slack_length"] = max(tendon, least)
    return properties


#: Folder next to a model where OpenSim looks for meshes.
FOLDER = "Geometry"


@dataclass(frozen=True, eq=False)
class ExportedMuscle:
    """A group of fibres as written, with errors.

    ``muscle`` is the name in the scene, ``out`` the muscle as written [m], fitted to the mean of ``fibres``.
    ``group_error`` is the RMS of the fibres' length changes against the mean [mm]; ``errors`` (f,) in the
    poses of the run are of ``"length"`` [mm], and of moment arms by coordinate [mm, 1 for a translation].
    """

    muscle: str
    out: MuscleOut
    fibres: tuple[int, ...]
    group_error: float
    errors: dict[str, Floats]

    def __str__(self) -> str:
        path = self.out.path
        if isinstance(path, FunctionPath):
            what = f"a polynomial of {', '.join(path.names)}, order {path.order}"
        else:
            what = f"{len(path.points)} points and {len(path.cylinders)} cylinders"
        sizes = [f"{of} {rms(off):.2g} (max {np.abs(off).max():.2g})" for of, off in self.errors.items()]
        listed = ", ".join([*sizes, f"group {self.group_error:.2g}"])
        return f"{len(self.fibres)} fibres as {what}; errors in mm: {listed}"
