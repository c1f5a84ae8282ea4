"""Joint coordinates: their values in each pose, their unit, and which way is up."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats

#: Units of angles, and how many radians they are.
ANGLES = {"deg": math.pi / 180.0, "rad": 1.0}
#: Units of translations, and how many millimetres they are.
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
        What its positive direction is, in words: ``"flexion"``, ``"right-handed about (1, 0, 0)"``.

    Raises
    ------
    ValueError
        If a value is not finite or there is no such unit.

    Examples
    --------
    >>> from vtkmuscle.core.motion.coordinates import Coordinate
    >>> Coordinate([0.0, 90.0], "deg", "flexion").natural.round(3)
    array([0.   , 1.571])
    """

    values: Floats
    unit: str = "deg"
    positive: str = ""

    def __post_init__(self) -> None:
        values = np.array(self.values, dtype=np.float64)
        if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
            raise InputError("", "the values of a coordinate must be a non-empty list of finite numbers")
        if self.unit not in (*ANGLES, *TRANSLATIONS):
            known = ", ".join(map(repr, (*ANGLES, *TRANSLATIONS)))
            raise InputError("", f"the unit of a coordinate is {self.unit!r}, but must be one of {known}")
        values.setflags(write=False)
        object.__setattr__(self, "values", values)

    @property
    def factor(self) -> float:
        """Radians per unit of an angle, millimetres per unit of a translation."""
        return {**ANGLES, **TRANSLATIONS}[self.unit]

    @property
    def natural(self) -> Floats:
        """The values (k,) in radians, or in millimetres: moment arms by it are in mm, or without a unit."""
        values: Floats = self.values * self.factor
        return values

    @property
    def changes(self) -> bool:
        """Whether it has more than one value, up to rounding."""
        return bool(np.ptp(self.values) > 1e-9 * max(1.0, float(np.abs(self.values).max())))
