"""A round muscle, 120 mm long, whose fibres wind around its axis, z, by a known angle."""

import numpy as np

from vtkmuscle.data.arrays import surface_from
from vtkmuscle.phantoms.meshing import solid_of_revolution

#: Length along z, radii of the flat ends and of the middle [mm].
LENGTH, END_RADIUS, BELLY_RADIUS = 120.0, 10.0, 18.0


def winding_surface():
    """Return the muscle's surface, 60 slices of 48 sides."""
    heights = np.linspace(0.0, LENGTH, 61)
    return surface_from(*solid_of_revolution(heights, radius_at(heights), 48))


def radius_at(z):
    """Return the muscle's radius at heights z [mm]."""
    return END_RADIUS + (BELLY_RADIUS - END_RADIUS) * np.sin(np.pi * z / LENGTH) ** 2


def winding_fibre(part, start, twist, t):
    """Return points (n, 3) [mm] of a fibre at the parts t (n,) of the muscle's height.

    It keeps to the same part of the radius, begins at the angle `start` [rad], and winds by `twist` [degrees]
    from end to end, right-handed about z.
    """
    z = LENGTH * t
    angle = start + np.radians(twist) * t
    return np.column_stack([part * radius_at(z) * np.cos(angle), part * radius_at(z) * np.sin(angle), z])


def winding_fibres(count, points=31, twist=90.0):
    """Return fibres that fill the muscle evenly."""
    parts, starts = np.sqrt((np.arange(count) + 0.5) / count), np.arange(count) * np.pi * (3.0 - 5.0**0.5)
    t = np.linspace(0.0, 1.0, points)
    return [winding_fibre(part, start, twist, t) for part, start in zip(parts, starts, strict=True)]
