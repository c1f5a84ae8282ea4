"""Rigid motions: transforms, turns, frames and tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, Slerp

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.motion.coordinates import Coordinate, twist_about
from vtkmuscle.core.types import Bools, Floats


def turns(axis: Floats, angles: Floats) -> Floats:
    """Return right-handed turns (f, 3, 3) about a unit axis. Angles (f,) [radians]."""
    return np.asarray(Rotation.from_rotvec(np.multiply.outer(angles, axis)).as_matrix())


def inverses(transforms: Floats) -> Floats:
    """Return the inverses of rigid transforms (f, 4, 4)."""
    result = np.array(transforms.swapaxes(1, 2), dtype=np.float64, order="C")
    result[:, :3, 3:] = -(transforms[:, :3, :3].swapaxes(1, 2) @ transforms[:, :3, 3:])
    result[:, 3, :3] = 0.0
    return result


def frame_at(centre: ArrayLike, angles: ArrayLike = (0.0, 0.0, 0.0)) -> Floats:
    """Return a turned frame (4, 4) at a position. Intrinsic rotations by angles (3,) [radians]."""
    result = np.eye(4)
    result[:3, :3] = Rotation.from_euler("XYZ", angles).as_matrix()
    result[:3, 3] = centre
    return result


#: Rounding of tables of six digits: of rotations [rad], and of positions as a part of the largest.
SIX_DIGITS = 1e-5


def are_rigid(transforms: Floats) -> Bools:
    """Return which transforms (..., 4, 4) are finite rotations and translations, without scale or mirror."""
    turns, shifts = transforms[..., :3, :3], transforms[..., :3, 3]
    with np.errstate(all="ignore"):  # numbers may be infinite
        off = np.abs(turns.swapaxes(-2, -1) @ turns - np.eye(3)).max(axis=(-2, -1))
        turned = (off <= SIX_DIGITS) & (np.linalg.det(turns) > 0.0)
    affine = (transforms[..., 3, :] == np.eye(4)[3]).all(axis=-1)
    return np.asarray(turned & affine & np.isfinite(shifts).all(axis=-1))


def apply_transform(transform: Floats, points: Floats) -> Floats:
    """Return points (n, 3) moved by a transform (4, 4)."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    moved = np.empty_like(points)
    transform_points(np.array(transform, dtype=np.float64), points.reshape(-1, 3), moved.reshape(-1, 3))
    return moved


@kernel
def transform_point(transform: Floats, points: Floats, i: int, moved: Floats) -> None:
    """Write point i, moved by a transform (4, 4). Of points (n, 3); moved : (3,), may be the point."""
    x, y, z = points[i, 0], points[i, 1], points[i, 2]
    for k in range(3):
        moved[k] = transform[k, 0] * x + transform[k, 1] * y + transform[k, 2] * z + transform[k, 3]


@kernel
def transform_points(transform: Floats, points: Floats, moved: Floats) -> None:
    """Write points (n, 3) moved by a transform (4, 4). moved : (n, 3), may be the points."""
    for i in range(len(points)):
        transform_point(transform, points, i, moved[i])


def inverse(transform: Floats) -> Floats:
    """Return the inverse of a rigid transform (4, 4)."""
    return np.asarray(inverses(transform[None])[0])


def rotation_about(centre: ArrayLike, axis: ArrayLike, angle: float) -> Floats:
    """Return the rotation (4, 4) about an axis [degrees]. Right-handed, through a centre."""
    c, direction = np.asarray(centre, dtype=np.float64), np.asarray(axis, dtype=np.float64)
    result = np.eye(4)
    turn = np.radians(angle) * (direction / np.linalg.norm(direction))
    result[:3, :3] = Rotation.from_rotvec(turn).as_matrix()
    result[:3, 3] = c - result[:3, :3] @ c
    return result


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """Tabulated motion of bones: a rigid transform per bone and time.

    Between two rows the rotation follows the shortest arc (slerp) and the joint centre a straight line, so a
    joint stays together. A bone without a table rests.

    Parameters
    ----------
    times : (k,) array
        Ascending pipeline times, in any unit (degrees of flexion, seconds).
    transforms : mapping of str to (k, 4, 4) array
        Per bone name, row major, mm.
    centre : (3,) array or mapping of str to (3,) array, optional
        Joint centre in the rest pose [mm], common or per bone; the origin by default.
    coordinates : mapping of str to Coordinate, optional
        Joint coordinates by name, with a value for each time, for moment arms.

    Raises
    ------
    ValueError
        If times do not ascend, shapes differ or a transform is not rigid.
    """

    times: Floats
    transforms: Mapping[str, Floats]
    centre: Floats | Mapping[str, Floats] | None = None
    coordinates: Mapping[str, Coordinate] = field(default_factory=dict)

    def __post_init__(self) -> None:
        times = np.array(self.times, dtype=np.float64)
        if times.ndim != 1 or not len(times) or not np.isfinite(times).all():
            raise InputError("", "the times of a motion must be a non-empty list of finite numbers")
        if (np.diff(times) <= 0).any():
            row = int(np.flatnonzero(np.diff(times) <= 0)[0]) + 1
            raise InputError("", f"the times of a motion must ascend; row {row} ({times[row]:g}) does not")
        object.__setattr__(self, "times", _frozen(times))
        checked = {}
        for bone, table in self.transforms.items():
            array = np.array(table, dtype=np.float64)
            if array.shape != (len(times), 4, 4):
                problem = f"transforms of shape {array.shape}, expected {(len(times), 4, 4)}"
                raise InputError(f"bone {bone!r}", problem)
            if not (rigid := are_rigid(array)).all():
                row = int(np.argmin(rigid))
                problem = f"the transform of row {row} (time {times[row]:g}) is not rigid"
                remedy = "it must be a rotation and a translation, with last row 0 0 0 1"
                raise InputError(f"bone {bone!r}", problem, remedy)
            checked[bone] = _frozen(array)
        object.__setattr__(self, "transforms", checked)
        centre = self.centre
        if isinstance(centre, Mapping):
            centre = {bone: _centre(position) for bone, position in centre.items()}
        elif centre is not None:
            centre = _centre(centre)
        object.__setattr__(self, "centre", centre)
        for name, coordinate in self.coordinates.items():
            if len(coordinate.values) != len(times):
                problem = f"{len(coordinate.values)} values, but there are {len(times)} times"
                raise InputError(f"coordinate {name!r}", problem)
        object.__setattr__(self, "coordinates", dict(self.coordinates))

    def at(self, time: float) -> dict[str, Floats]:
        """Return each moving bone's transform (4, 4) at a time. Beyond the table, the end row counts."""
        time = min(max(time, float(self.times[0])), float(self.times[-1]))
        upper = int(self.times.searchsorted(time))
        if self.times[upper] == time:
            return {bone: table[upper] for bone, table in self.transforms.items()}
        ends = slice(upper - 1, upper + 1)
        fraction = (time - self.times[upper - 1]) / (self.times[upper] - self.times[upper - 1])
        tables = self.transforms.items()
        return {bone: _between(table[ends], fraction, self.centre_of(bone)) for bone, table in tables}

    def centre_of(self, bone: str) -> Floats:
        """Return the joint centre (3,) of a bone at rest."""
        centre = self.centre.get(bone) if isinstance(self.centre, Mapping) else self.centre
        return np.zeros(3) if centre is None else centre

    def part(self, frames: ArrayLike) -> "RigidMotion":
        """Return the motion at some times, by ascending numbers."""
        kept = np.asarray(frames, dtype=np.int64)
        transforms = {bone: table[kept] for bone, table in self.transforms.items()}
        coordinates = {name: coordinate.part(kept) for name, coordinate in self.coordinates.items()}
        return RigidMotion(self.times[kept], transforms, self.centre, coordinates)

    def by(self, names: Sequence[str]) -> "RigidMotion":
        """Return the motion with only the named coordinates."""
        return replace(self, coordinates={name: self.coordinates[name] for name in names})


def hinge(
    bone: str, centre: ArrayLike, axis: ArrayLike, angles: ArrayLike, *, coordinate: str | None = None
) -> RigidMotion:
    """Return the motion of a bone about a fixed axis.

    Parameters
    ----------
    bone : str
        Name of the moving bone.
    centre : (3,) array_like
        A point on the axis [mm].
    axis : (3,) array_like
        Direction of the axis; positive angles turn right-handed.
    angles : (k,) array_like
        Ascending angles from rest [degrees], also the pipeline's times.
    coordinate : str, optional
        Name of the angle, e.g. ``"knee_flexion"``; by default ``"BONE_angle"``.

    Returns
    -------
    RigidMotion
        With a row per angle, and the angle as coordinate.

    Raises
    ------
    ValueError
        If the axis has no length or is not finite, or if consecutive angles differ by 180 degrees or more:
        the shortest arc between them would leave the hinge.

    Examples
    --------
    >>> from vtkmuscle.core.motion.rigid import hinge
    >>> knee = hinge("tibia", centre=(0, 0, 0), axis=(1, 0, 0), angles=[0, 10, 20])
    >>> knee.at(15.0)["tibia"].shape
    (4, 4)
    """
    direction = np.asarray(() if isinstance(axis, str) else axis, dtype=np.float64)
    length = np.linalg.norm(direction)
    if not (np.isfinite(length) and length > 0):
        problem = f"the axis of a hinge must be finite and have a length, but is {axis!r}"
        raise InputError("", problem, "e.g. (1, 0, 0)")
    times, position = np.asarray(angles, dtype=np.float64), _centre(centre)
    if (np.diff(times) >= 180.0).any():
        raise InputError("", "successive angles of a hinge must differ by less than 180 degrees")
    table = np.array([rotation_about(position, axis, angle) for angle in times])
    written = ", ".join(f"{component:g}" for component in direction)
    twists = np.tile(twist_about(position, axis), (len(times), 1))
    angle = Coordinate(times, "deg", f"right-handed about ({written})", {bone: twists})
    return RigidMotion(times, {bone: table}, position, {coordinate or f"{bone}_angle": angle})


def _between(pair: Floats, fraction: float, centre: Floats) -> Floats:
    result = np.eye(4)
    rotations = Rotation.from_matrix(pair[:, :3, :3].copy())  # SciPy < 1.17 wants to write
    result[:3, :3] = Slerp([0.0, 1.0], rotations)(fraction).as_matrix()
    ends = pair[:, :3, :3] @ centre + pair[:, :3, 3]
    result[:3, 3] = (1.0 - fraction) * ends[0] + fraction * ends[1] - result[:3, :3] @ centre
    return result


def _centre(values: ArrayLike) -> Floats:
    centre = np.array(values, dtype=np.float64)
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise InputError("", "the centre of a motion must be three finite numbers")
    return _frozen(centre)


def _frozen(array: Floats) -> Floats:
    array.setflags(write=False)
    return array


def centred(transforms: Floats, centre: Floats) -> Floats:
    """Return transforms (b, 4, 4) relative to a centre (3,)."""
    about = np.array(transforms)
    about[:, :3, 3] += about[:, :3, :3] @ centre - centre
    return about
