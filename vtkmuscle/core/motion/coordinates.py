"""Joint coordinates: their values in each pose, their unit, and how each moves the bones."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats, Ints


def twist_about(centre: ArrayLike, axis: ArrayLike) -> Floats:
    """Return the twist (6,) of a right-handed turn by a radian about an axis through a centre."""
    direction = np.asarray(axis, dtype=np.float64)
    direction = direction / np.linalg.norm(direction)
    return np.concatenate([np.cross(np.asarray(centre, dtype=np.float64), direction), direction])


def carried_twists(twists: Floats, transform: Floats) -> Floats:
    """Return the twists (..., 6) of bodies after an isometry (4, 4) of all space, mirrors included."""
    linear, shift = transform[:3, :3], transform[:3, 3]
    angular = np.linalg.det(linear) * twists[..., 3:] @ linear.T
    return np.concatenate([twists[..., :3] @ linear.T + np.cross(shift, angular), angular], axis=-1)


#: Units of angles, in radians.
ANGLES = {"deg": math.pi / 180.0, "rad": 1.0}
#: Units of translations, in millimetres.
TRANSLATIONS = {"mm": 1.0, "cm": 10.0, "m": 1000.0}


@dataclass(frozen=True, eq=False)
class Coordinate:
    """A coordinate of a joint over the poses of a motion.

    Parameters
    ----------
    values : (k,) array
        Its value in each pose, in its unit.
    unit : str, optional
        ``"deg"`` or ``"rad"`` for an angle, ``"mm"``, ``"cm"`` or ``"m"`` for a translation.
    positive : str, optional
        Its positive direction in words: ``"flexion"``, ``"right-handed about (1, 0, 0)"``.
    twists : mapping of str to (k, 6) array, optional
        For a known joint, how the coordinate moves each bone in each pose: velocity at the origin and angular
        velocity, per radian or millimetre. Bones that are missing do not move with it. None: the differences
        between poses are taken.

    Raises
    ------
    ValueError
        If a value is not finite, twists are not one per value, or there is no such unit.

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
        if self.unit not in (*ANGLES, *TRANSLATIONS):
            known = ", ".join(map(repr, (*ANGLES, *TRANSLATIONS)))
            raise InputError("", f"the unit of a coordinate is {self.unit!r}, but must be one of {known}")
        for bone, found in (self.twists or {}).items():
            if np.shape(found) != (len(values), 6) or not np.isfinite(found).all():
                raise InputError(
                    "",
                    f"the twists of {bone!r} are of shape {np.shape(found)}, but must be finite numbers of "
                    f"shape {(len(values), 6)}",
                )
        values.setflags(write=False)
        object.__setattr__(self, "values", values)

    @property
    def factor(self) -> float:
        """Radians per unit of an angle, millimetres per unit of a translation."""
        return {**ANGLES, **TRANSLATIONS}[self.unit]

    @property
    def natural(self) -> Floats:
        """The values (k,) in radians or millimetres: moment arms by it are in mm, or without a unit."""
        return self.values * self.factor

    @property
    def changes(self) -> bool:
        """Whether it has more than one value, up to rounding."""
        return bool(np.ptp(self.values) > 1e-9 * max(1.0, float(np.abs(self.values).max())))

    def part(self, frames: Ints) -> Self:
        """Return the coordinate in some of its poses, given by their numbers."""
        twists = None if self.twists is None else {bone: one[frames] for bone, one in self.twists.items()}
        return replace(self, values=self.values[frames], twists=twists)

    def carried(self, transform: Floats) -> Self:
        """Return the coordinate after an isometry (4, 4) of all space, mirrors included."""
        if self.twists is None:
            return self
        twists = {bone: carried_twists(one, transform) for bone, one in self.twists.items()}
        return replace(self, twists=twists)
