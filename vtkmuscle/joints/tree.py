"""Kinematic trees: bodies on joints, and body poses."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.coordinates import ANGLES, MILLIMETRES
from vtkmuscle.core.motion.rigid import inverses, turns
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.joints.functions import CoordinateFunction

#: Half step of central differences by a coordinate [rad, or the coordinate's unit]: the truncation error of a
#: sine is a sixth of the square, 2e-9, and the rounding error about 1e-12 of lengths.
HALF_STEP = 1e-4


@dataclass(frozen=True)
class JointCoordinate:
    """A coordinate of a joint, in radians, or in mm, cm or m for a translation.

    ``rest`` is the value by default, ``range`` least and largest, ``positive`` the direction in words. A
    ``locked`` coordinate stays at rest.
    """

    name: str
    unit: str = "rad"
    rest: float = 0.0
    range: tuple[float, float] | None = None
    positive: str = ""
    locked: bool = False

    @property
    def is_angle(self) -> bool:
        """Whether the coordinate is an angle."""
        return self.unit in ANGLES

    def scaled(self, factor: float) -> "JointCoordinate":
        """Return the coordinate with scaled rest and range."""
        limits = self.range and (factor * self.range[0], factor * self.range[1])
        return replace(self, rest=factor * self.rest, range=limits)


@dataclass(frozen=True, eq=False)
class JointAxis:
    """A turn or slide about or along an axis (3,) of any length.

    The amount [radians, or the tree's unit of length] is a function of a coordinate; the coordinate is None
    for a constant.
    """

    axis: Floats
    function: CoordinateFunction
    coordinate: str | None = None

    def __post_init__(self) -> None:
        axis = np.array(self.axis, dtype=np.float64)
        with np.errstate(over="ignore"):
            length = float(np.linalg.norm(axis)) if axis.shape == (3,) else np.nan
        if not (np.isfinite(length) and length > 0.0):
            raise InputError("", f"a joint's axis must be 3 finite numbers and have a length, but is {axis}")
        object.__setattr__(self, "axis", axis / length)

    def at(self, values: Mapping[str, Floats], frames: int) -> Floats:
        """Return the amount (f,) for values (f,) of coordinates."""
        return self.function(np.zeros(frames) if self.coordinate is None else values[self.coordinate])


@dataclass(frozen=True, eq=False)
class Joint:
    """The movement of a body against the parent body.

    The child's joint frame is turned against the parent's about each axis in turn, the later axes going along
    with the earlier turns, and is shifted along axes of the parent's joint frame. ``parent_frame`` and
    ``child_frame`` (4, 4) are the joint's frames in either body, ``kind`` is the joint's type in a file.
    """

    name: str
    parent: str
    child: str
    rotations: Sequence[JointAxis] = ()
    translations: Sequence[JointAxis] = ()
    parent_frame: Floats = field(default_factory=lambda: np.eye(4))
    child_frame: Floats = field(default_factory=lambda: np.eye(4))
    kind: str = "custom"

    @property
    def axes(self) -> tuple[JointAxis, ...]:
        """Turns, then slides."""
        return (*self.rotations, *self.translations)

    def transforms(self, values: Mapping[str, Floats], frames: int) -> Floats:
        """Return the child's frame in the parent (f, 4, 4) for values (f,)."""
        result = np.tile(np.eye(4), (frames, 1, 1))
        for axis in self.rotations:
            result[:, :3, :3] = result[:, :3, :3] @ turns(axis.axis, axis.at(values, frames))
        for axis in self.translations:
            result[:, :3, 3] += axis.at(values, frames)[:, None] * axis.axis
        return np.asarray(self.parent_frame @ result @ inverses(self.child_frame[None])[0])


@dataclass(frozen=True, eq=False)
class Coupling:
    """A coordinate as a function of an independent coordinate, as of a patella."""

    dependent: str
    independent: str
    function: CoordinateFunction


@dataclass(frozen=True, eq=False)
class KinematicTree:
    """Bodies on joints, and poses for coordinates.

    All bodies hang on the root; each body except the root is the child of a single joint. The order of
    joints is free. ValueError if the joints are no tree, or joints or couplings name an unknown coordinate.

    Examples
    --------
    >>> from vtkmuscle.joints.functions import IDENTITY
    >>> from vtkmuscle.joints.tree import Joint, JointAxis, JointCoordinate, KinematicTree
    >>> knee = Joint("knee", "femur", "tibia", [JointAxis((0, 0, 1), IDENTITY, "knee_angle")])
    >>> leg = KinematicTree("femur", [knee], [JointCoordinate("knee_angle")])
    >>> leg.poses({"knee_angle": [0.0, 0.5]})["tibia"].shape
    (2, 4, 4)
    """

    root: str
    joints: Sequence[Joint]
    coordinates: Sequence[JointCoordinate]
    couplings: Sequence[Coupling] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", tuple(_joints_in_order(self.root, self.joints)))
        for what, names in (
            ("coordinate", [coordinate.name for coordinate in self.coordinates]),
            ("joint", [joint.name for joint in self.joints]),
            ("coupled coordinate", [coupling.dependent for coupling in self.couplings]),
        ):
            if twice := [name for name in names if names.count(name) > 1]:
                raise InputError("", f"there are two of the {what} {twice[0]!r}")
        used = [(axis.coordinate, f"joint {joint.name!r}: ") for joint in self.joints for axis in joint.axes]
        used += [(q, "a coupling: ") for each in self.couplings for q in (each.dependent, each.independent)]
        for name, where in used:
            if name:
                self.coordinate(name, where)
        object.__setattr__(self, "couplings", tuple(_couplings_in_order(self.couplings)))

    @property
    def bodies(self) -> tuple[str, ...]:
        """The root, then each body after the parent."""
        return (self.root, *(joint.child for joint in self.joints))

    @property
    def free(self) -> tuple[str, ...]:
        """Coordinates without a coupling."""
        dependent = {coupling.dependent for coupling in self.couplings}
        return tuple(each.name for each in self.coordinates if each.name not in dependent)

    def coordinate(self, name: str, where: str = "") -> JointCoordinate:
        """Return a coordinate by name; an unknown name raises a ValueError."""
        by_name = {coordinate.name: coordinate for coordinate in self.coordinates}
        if name not in by_name:
            raise InputError("", f"{where}there is no coordinate {name!r}", suggestion(name, sorted(by_name)))
        return by_name[name]

    def completed(self, values: Mapping[str, ArrayLike]) -> dict[str, Floats]:
        """Return the values (f,) of all coordinates.

        Coupled coordinates follow the couplings; coordinates without a value are at rest. Input values (f,)
        are by coordinate, in its unit; numbers hold for all frames. An unknown coordinate, unequal lengths,
        or a value that is not finite raise a ValueError.
        """
        columns = {name: np.asarray(value, dtype=np.float64) for name, value in values.items()}
        shapes = {column.shape for column in columns.values() if column.ndim}
        if len(shapes) > 1 or any(len(shape) != 1 for shape in shapes):
            raise InputError("", f"coordinates have values of the shapes {sorted(shapes)}, but must be alike")
        frames = shapes.pop()[0] if shapes else 1
        for name, column in columns.items():
            self.coordinate(name)
            if not np.isfinite(column).all():
                raise InputError("", f"coordinate {name!r} has a value that is not finite")
        result = {coordinate.name: np.full(frames, coordinate.rest) for coordinate in self.coordinates}
        result |= {name: np.broadcast_to(column, (frames,)) for name, column in columns.items()}
        for coupling in self.couplings:
            dependent, independent = coupling.dependent, coupling.independent
            with np.errstate(over="ignore", invalid="ignore"):
                result[dependent] = coupling.function(result[independent])
            if not np.isfinite(result[dependent]).all():
                raise InputError("", f"coordinate {dependent!r} follows {independent!r} beyond all numbers")
        return result

    def poses(self, values: Mapping[str, ArrayLike], on: Iterable[str] | None = None) -> dict[str, Floats]:
        """Return each body's frame in the root (f, 4, 4), for values as in :meth:`completed`.

        ``on`` names the bodies to place, along with the bodies up to the root; by default all.
        """
        wanted = {joint.child for body in on or self.bodies for joint in self.way_up(body)}
        full = self.completed(values)
        frames = len(next(iter(full.values()))) if full else 1
        result = {self.root: np.tile(np.eye(4), (frames, 1, 1))}
        for joint in (joint for joint in self.joints if joint.child in wanted):
            with np.errstate(over="ignore", invalid="ignore"):
                result[joint.child] = result[joint.parent] @ joint.transforms(full, frames)
            if not np.isfinite(result[joint.child]).all():
                raise InputError("", f"joint {joint.name!r} moves {joint.child!r} to infinity")
        return result

    def scaled(self, length: float, coordinates: Mapping[str, float] | None = None) -> "KinematicTree":
        """Return a tree in other units, by factors of lengths and coordinates."""
        factors = {each.name: 1.0 for each in self.coordinates} | dict(coordinates or {})

        def scaled_axis(axis: JointAxis, result: float) -> JointAxis:
            own = 1.0 if axis.coordinate is None else factors[axis.coordinate]
            return replace(axis, function=axis.function.rescaled(own, result))

        scale = np.ones((4, 4))
        scale[:3, 3] = length
        joints = []
        for joint in self.joints:
            turns = [scaled_axis(axis, 1.0) for axis in joint.rotations]
            slides = [scaled_axis(axis, length) for axis in joint.translations]
            frames = scale * joint.parent_frame, scale * joint.child_frame
            joints.append(Joint(joint.name, joint.parent, joint.child, turns, slides, *frames, joint.kind))
        couplings = [
            replace(each, function=each.function.rescaled(factors[each.independent], factors[each.dependent]))
            for each in self.couplings
        ]
        own = [each.scaled(factors[each.name]) for each in self.coordinates]
        return KinematicTree(self.root, joints, own, couplings)

    def in_metres(self, metres: float) -> tuple["KinematicTree", dict[str, float]]:
        """Return the tree in metres, and factors for coordinates. ``metres`` are per unit of length."""
        factors = {each.name: MILLIMETRES.get(each.unit, 1000.0) / 1000.0 for each in self.coordinates}
        tree = self.scaled(metres, factors)
        coordinates = [each if each.is_angle else replace(each, unit="m") for each in tree.coordinates]
        return replace(tree, coordinates=coordinates), factors

    def crossed(self, bodies: Sequence[str]) -> tuple[str, ...]:
        """Return the free coordinates that move bodies against each other."""
        chains = [{joint.name: joint for joint in self.way_up(body)} for body in bodies]
        common = set.intersection(*map(set, chains)) if chains else set()
        moving = [joint for chain in chains for name, joint in chain.items() if name not in common]
        return self.freed(axis.coordinate for joint in moving for axis in joint.axes)

    def way_up(self, body: str) -> Iterator[Joint]:
        """Yield the joints from a body to the root."""
        parents = {joint.child: joint for joint in self.joints}
        while body in parents:
            yield parents[body]
            body = parents[body].parent

    def freed(self, coordinates: Iterable[str | None]) -> tuple[str, ...]:
        """Return the free coordinates behind coordinates. Couplings lead to the independent coordinate."""
        names = set(coordinates)
        for coupling in reversed(self.couplings):
            if coupling.dependent in names:
                names.add(coupling.independent)
        return tuple(name for name in self.free if name in names)


def _joints_in_order(root: str, joints: Sequence[Joint]) -> Iterator[Joint]:
    """Give each joint after the parent's joint."""
    waiting: dict[str, list[Joint]] = {}
    seen: dict[str, str] = {root: ""}
    for joint in joints:
        if joint.child in seen:
            other = f"is the child of {seen[joint.child]!r}, too" if seen[joint.child] else "is the root"
            raise InputError("", f"joint {joint.name!r}: the child {joint.child!r} {other}")
        seen[joint.child] = joint.name
        waiting.setdefault(joint.parent, []).append(joint)
    todo = [root]
    while todo:
        for joint in waiting.pop(todo.pop(0), []):
            todo.append(joint.child)
            yield joint
    for parent, left in waiting.items():
        ring = f"no joint connects the parent to {root!r}: the joints form a loop"
        why = ring if parent in seen else "there is no such body"
        raise InputError("", f"joint {left[0].name!r}: the parent is {parent!r}, but {why}")


def _couplings_in_order(couplings: Sequence[Coupling]) -> Iterator[Coupling]:
    """Yield each coupling after that of its independent coordinate."""
    by_name = {coupling.dependent: coupling for coupling in couplings}
    sorter = TopologicalSorter({coupling.dependent: (coupling.independent,) for coupling in couplings})
    try:
        order = list(sorter.static_order())
    except CycleError as error:
        raise InputError("", f"couplings go round in a ring: {', '.join(error.args[1][1:])}") from None
    return (by_name[name] for name in order if name in by_name)
