"""Straps, which are flat, along a middle line in the plane across a hinge, and rings on ends."""

import numpy as np
from numpy.typing import ArrayLike

from phantoms.planar import evenly, in_space
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms.implicit import Solid, thick_sheet

#: Distance of the points on the middle line that a strap is made from [mm].
SPACING = 2.5


def strap(line: Floats, width: float, thickness: float) -> Solid:
    """Return a strap about a middle line, with flat ends across it.

    Returns
    -------
    Solid
        Half the thickness to each side of the line.
    """
    middle = in_space(evenly(longer(line, thickness), SPACING))
    across = np.linspace(-1.0, 1.0, 3)[:, None] * [(width - thickness) / 2.0, 0.0, 0.0]
    knots = middle[:, None, :] + across
    return cut_ends(thick_sheet(knots, np.full(knots.shape[:2], thickness / 2.0), spacing=1.5), line)


def end_ring(centre: ArrayLike, along: ArrayLike, width: float, thickness: float) -> Floats:
    """Return landmarks (8, 3) on the flat end of a strap."""
    y, z = _unit(np.asarray(along, dtype=np.float64))
    side, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, -z, y])
    corners = np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)])
    ring: Floats = (
        in_space(np.asarray(centre, dtype=np.float64)[None])
        + (width - thickness) / 2.0 * corners[:, :1] * side
        + 0.35 * thickness * corners[:, 1:] * up
    )
    return ring


def round_ring(centre: ArrayLike, along: ArrayLike, radius: float) -> Floats:
    """Return landmarks (12, 3) on the flat end of a cord, in a circle [mm], as :func:`end_ring` does."""
    y, z = _unit(np.asarray(along, dtype=np.float64))
    turns = 2.0 * np.pi * np.arange(12)[:, None] / 12
    circle = np.cos(turns) * [1.0, 0.0, 0.0] + np.sin(turns) * [0.0, -z, y]
    ring: Floats = in_space(np.asarray(centre, dtype=np.float64)[None]) + radius * circle
    return ring


def longer(line: Floats, by: float) -> Floats:
    """Return a line that goes on straight at both ends: those of sheets and curves are round, to be cut."""
    first, last = _unit(line[1] - line[0]), _unit(line[-1] - line[-2])
    return np.vstack([line[0] - by * first, line, line[-1] + by * last])


def cut_ends(solid: Solid, line: Floats) -> Solid:
    """Return what of a solid about a line is between the planes across its ends."""
    first, last = _unit(line[1] - line[0]), _unit(line[-1] - line[-2])
    return solid.cut_by((0.0, *line[0]), (0.0, *-first), 1.0).cut_by((0.0, *line[-1]), (0.0, *last), 1.0)


def _unit(vector: Floats) -> Floats:
    unit: Floats = vector / np.linalg.norm(vector)
    return unit


def block(lower: ArrayLike, upper: ArrayLike, *, rim: float = 2.0) -> Solid:
    """Return a box along the axes, its edges rounded over ``rim`` [mm]."""
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)

    def face(points: Floats) -> tuple[Floats, Floats]:
        return points[:, 0] - high[0], np.tile([1.0, 0.0, 0.0], (len(points), 1))

    solid = Solid(face, low, high)
    for axis in range(3):
        normal = np.eye(3)[axis]
        solid = solid.cut_by(low, -normal, rim)
        solid = solid if axis == 0 else solid.cut_by(high, normal, rim)
    return solid
