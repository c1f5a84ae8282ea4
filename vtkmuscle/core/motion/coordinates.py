"""Joint coordinates: values per pose, units, and twists of bones."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import ROUNDING, Floats, Ints


def twist_about(centre: ArrayLike, axis: ArrayLike) -> Floats:
    """Return the twist (6,) of a turn by a radian. The axis passes the centre; the turn is right-handed."""
    direction = np.asarray(axis, dtype=np.float64)
    direction = direction / np.linalg.norm(direction)
    return np.concatenate([np.cross(np.asarray(centre, dtype=np.float64), direction), direction])


def carried_twists(twists: Floats, transform: Floats) -> Floats:
    """Return twists (..., 6) after an isometry (4, 4). Mirrors are allowed."""
    linear, shift = transform[:3, :3], transform[:3, 3]
    angular = np.linalg.det(linear) * twists[..., 3:] @ linear.T
    return np.concatenate([twists[..., :3] @ linear.T + np.cross(shift, angular), angular], axis=-1)


#: Units of angles, in radians.
ANGLES = {"deg": math.pi / 180.0, "rad": 1.0}
#: Units of lengths, in millimetres.
MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0}


@dataclass(frozen=True, eq=False)
class Coordinate:
    """Joint coordinate over the poses of a motion.

    Parameters
    ----------
    values : (k,) array
        Value in each pose, in the coordinate's unit.
    unit : str, optional
        ``"deg"`` or ``"rad"`` for an angle, ``"mm"``, ``"cm"`` or ``"m"`` for a translation.
    positive : str, optional
        Positive direction in words: ``"flexion"``, ``"right-handed about (1, 0, 0)"``.
    twists : mapping of str to (k, 6) array, optional
        Motion of each bone by the coordinate in each pose, for a modelled joint: velocity at the origin and
        angular velocity, per radian or millimetre. Missing bones do not move. None: differences between poses
        replace twists.

    Raises
    ------
    ValueError
        If a value is not finite, the number of twists differs, or the unit is unknown.

    Examples
    --------
    >>> from vtkmuscle.core.motion.coordinates import Coordinate
    >>> Coordinate([0.0, 90.0], "deg", "flexion").natural.round(3)
    array([0.   , 1.571])
    """

    values: Floats
    unit: str = "deg"
    positive: str = ""
    twists: Mapping[str, Floats] | None = None

    def __post_init__(self) -> None:
        values = np.array(self.values, dtype=np.float64)
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise InputError("", "the values of a coordinate must be a non-empty list of finite numbers")
        if self.unit not in (*ANGLES, *MILLIMETRES):
            units = ", ".join(map(repr, (*ANGLES, *MILLIMETRES)))
            raise InputError("", f"the unit of a coordinate is {self.unit!r}, but must be one of {units}")
        for bone, twists in (self.twists or {}).items():
            if np.shape(twists) != (len(values), 6) or not np.isfinite(twists).all():
                problem = f"the twists of {bone!r} have shape {np.shape(twists)}, but must be finite numbers"
                raise InputError("", f"{problem} of shape {(len(values), 6)}")
        values.setflags(write=False)
        object.__setattr__(self, "values", values)

    @property
    def factor(self) -> float:
        """Radians or millimetres per unit."""
        return {**ANGLES, **MILLIMETRES}[self.unit]

    @property
    def natural(self) -> Floats:
        """Values (k,) in radians or millimetres."""
        return self.values * self.factor

    @property
    def changes(self) -> bool:
        """True for several values, up to rounding."""
        return bool(np.ptp(self.values) > ROUNDING * max(1.0, float(np.abs(self.values).max())))

    def part(self, frames: Ints) -> Self:
        """Return the coordinate in some poses, by number."""
        twists = self.twists and {bone: table[frames] for bone, table in self.twists.items()}
        return replace(self, values=self.values[frames], twists=twists)

    def carried(self, transform: Floats) -> Self:
        """Return the coordinate after an isometry (4, 4). Mirrors included."""
        twists = self.twists and {bone: carried_twists(each, transform) for bone, each in self.twists.items()}
        return replace(self, twists=twists)
