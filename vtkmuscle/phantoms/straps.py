"""Flat muscles of one width and thickness along a middle line in the plane across a hinge."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vtkmuscle.phantoms.implicit import Solid, thick_sheet
from vtkmuscle.phantoms.planar import evenly, in_space

Floats = NDArray[np.float64]

#: Distance of the points on the middle line that a strap is made from [mm].
SPACING = 2.5


def strap(line: Floats, width: float, thickness: float) -> Solid:
    """Return a strap about a middle line, with flat ends across it.

    Parameters
    ----------
    line : (k, 2) array
        The middle line, (y, z) at x = 0 [mm].
    width : float
        Along x [mm]; the strap's edges are round, so that its faces are flat over ``width - thickness``.
    thickness : float
        Of the strap [mm].

    Returns
    -------
    Solid
        Half the thickness to each side of the line.
    """
    first, last = _unit(line[1] - line[0]), _unit(line[-1] - line[-2])
    # Longer than it is to be, and then cut: the ends of a sheet are round.
    longer = np.vstack([line[0] - thickness * first, line, line[-1] + thickness * last])
    middle = in_space(evenly(longer, SPACING))
    across = np.linspace(-1.0, 1.0, 3)[:, None] * [(width - thickness) / 2.0, 0.0, 0.0]
    knots = middle[:, None, :] + across
    solid = thick_sheet(knots, np.full(knots.shape[:2], thickness / 2.0), spacing=1.5)
    solid = solid.beside((0.0, *line[0]), (0.0, *-first), 1.0)
    return solid.beside((0.0, *line[-1]), (0.0, *last), 1.0)


def end_ring(centre: ArrayLike, along: ArrayLike, width: float, thickness: float) -> Floats:
    """Return landmarks (8, 3) on the flat end of a strap.

    Parameters
    ----------
    centre, along : (2,) array_like
        Where the middle line ends [mm], and its direction there.
    width, thickness : float
        Of the strap [mm].
    """
    y, z = _unit(np.asarray(along, dtype=np.float64))
    side, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, -z, y])
    corners = np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)])
    ring: Floats = (
        in_space(np.asarray(centre, dtype=np.float64)[None])
        + (width - thickness) / 2.0 * corners[:, :1] * side
        + 0.35 * thickness * corners[:, 1:] * up
    )
    return ring


def _unit(vector: Floats) -> Floats:
    unit: Floats = vector / np.linalg.norm(vector)
    return unit
