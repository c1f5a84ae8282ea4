"""A spindle whose fibres wind around its axis, by a known angle."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, polylines_from
from vtkmuscle.phantoms.fibre_bodies import LENGTH, PLATE, SPACING, sliding
from vtkmuscle.phantoms.meshing import box, solid_of_revolution, volume_of_revolution
from vtkmuscle.phantoms.phantom import Phantom, circle, ends, phantom_from

#: Radii of the spindle's flat ends and of its middle [mm].
END_RADIUS, BELLY_RADIUS = 10.0, 18.0
#: The spindle is a stack of slices, regular polygons: how many, and of how many sides.
SLICES, SIDES = 60, 48
#: Points of each superficial fibre, and the part of the length that it is seen on.
SEEN_POINTS, SEEN = 9, (0.2, 0.8)


def winding_spindle(twist: float = 60.0, *, n_superficial: int = 5) -> Phantom:
    """Return a round muscle between two plates, whose fibres wind around its axis.

    The fibre through the point at the radius q r(0) and the angle p of the lower end is at the height z at
    the radius q r(z) and the angle p + twist z / 120 mm. The muscle's shape does not show the twist; a few
    superficial fibres, digitised on the middle part of the surface, do. The plate ``insertion_plate`` moves
    down along z, by the pipeline's time in mm.

    Parameters
    ----------
    twist : float, optional
        Of the upper end, the insertion, against the lower one, right-handed about z [degrees].
    n_superficial : int, optional
        Superficial fibres, evenly around.

    Returns
    -------
    Phantom
        With ``superficial``. Known answers: ``known["twist"]`` [degrees], ``known["volume"]`` [mm^3] and
        ``known["fibre_length"](q)`` [mm], of a fibre at the part q of the radius.

    Examples
    --------
    >>> from phantoms import winding_spindle
    >>> phantom = winding_spindle(90.0)
    >>> phantom.superficial["spindle"].GetNumberOfCells(), phantom.known["twist"]
    (5, 90.0)
    """
    heights = np.linspace(0.0, LENGTH, SLICES + 1)
    ring = circle(END_RADIUS)
    low, high = np.array([-16.0, -16.0, -PLATE]), np.array([16.0, 16.0, 0.0])
    up = np.array([0.0, 0.0, LENGTH + PLATE])
    starts = 2.0 * np.pi * (np.arange(n_superficial) + 0.25) / n_superficial
    seen = [winding_fibre(1.0, start, twist, np.linspace(*SEEN, SEEN_POINTS)) for start in starts]
    lines = Polylines(np.vstack(seen), np.arange(0, SEEN_POINTS * n_superficial + 1, SEEN_POINTS))
    return phantom_from(
        "winding_spindle",
        bones={"origin_plate": box(low, high, SPACING), "insertion_plate": box(low + up, high + up, SPACING)},
        muscles={"spindle": solid_of_revolution(heights, radius_at(heights), SIDES)},
        areas={"spindle": ends("origin_plate", ring, "insertion_plate", np.add(ring, [0.0, 0.0, LENGTH]))},
        motion=sliding("insertion_plate", (0, 0, -1)),
        known={
            "twist": twist,
            "volume": volume_of_revolution(heights, radius_at(heights), SIDES),
            "fibre_length": lambda part: _length(part, twist),
        },
        superficial={"spindle": polylines_from(lines)},
    )


def radius_at(z: Floats) -> Floats:
    """Return the spindle's radius at heights z [mm]."""
    return END_RADIUS + (BELLY_RADIUS - END_RADIUS) * np.sin(np.pi * z / LENGTH) ** 2


def winding_fibre(part: float, start: float, twist: float, t: Floats) -> Floats:
    """Return points (n, 3) of a fibre [mm], at parts t of the height.

    ``part`` of the radius is its distance from the axis, ``start`` its angle at the origin [rad], ``twist``
    that of the insertion against the origin [degrees].
    """
    z = LENGTH * t
    angle = start + np.radians(twist) * t
    return np.column_stack([part * radius_at(z) * np.cos(angle), part * radius_at(z) * np.sin(angle), z])


def _length(part: float, twist: float) -> float:
    points = winding_fibre(part, 0.0, twist, np.linspace(0.0, 1.0, 2001))
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
