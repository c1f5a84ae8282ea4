"""Points in a plane across a hinge.

The hinge is along x: a point is (y, z), and flexion turns about -x, what is below the
hinge to the front, -y.
"""

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.types import Floats


def turned(point: ArrayLike, angle: float) -> Floats:
    """Return a point (2,) turned about the origin, from y to z [rad]."""
    y, z = np.asarray(point, dtype=np.float64)
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * y - s * z, s * y + c * z])


def flexed(point: ArrayLike, degrees: float) -> Floats:
    """Return a point (2,) after flexion about the origin."""
    return turned(point, -float(np.radians(degrees)))


def evenly(points: Floats, spacing: float) -> Floats:
    """Return points (n, d) evenly apart by about a spacing [mm] on a chain of points, its ends included."""
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    places = np.linspace(0.0, along[-1], int(np.ceil(along[-1] / spacing)) + 1)
    return np.column_stack([np.interp(places, along, column) for column in points.T])


def in_space(points: ArrayLike) -> Floats:
    """Return points (n, 3) at x = 0 of points (n, 2) of the plane."""
    plane = np.asarray(points, dtype=np.float64)
    return np.column_stack([np.zeros(len(plane)), plane])
