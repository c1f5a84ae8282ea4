"""Cords, which are round, along a middle line in the plane across a hinge."""

import numpy as np
from numpy.typing import ArrayLike

from phantoms.planar import evenly, in_space
from phantoms.straps import SPACING, cut_ends, longer
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms.implicit import Solid, thick_curve


def cord(line: Floats, radii: ArrayLike) -> Solid:
    """Return a round muscle about a middle line, with flat ends across it."""
    given = np.asarray(radii, dtype=np.float64)
    middle = evenly(longer(line, float(given[[0, -1]].max())), 2.0 * SPACING)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(middle, axis=0), axis=1)))
    ends = along[-1] * np.linspace(0.0, 1.0, len(given))
    return cut_ends(thick_curve(in_space(middle), np.interp(along, ends, given), spacing=1.5), line)
