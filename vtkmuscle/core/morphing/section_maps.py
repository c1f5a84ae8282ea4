"""Maps of the template's rectangle to a section of the muscle, flat or in space."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.morphing.correspondence import (
    N_PLACES,
    cornered_loop,
    loop_lengths,
    refined_loop,
    rolled_loop,
    split_chain,
    subdivided_rectangle,
)
from vtkmuscle.core.morphing.planar_coordinates import mean_value_weights
from vtkmuscle.core.types import Floats


@dataclass(frozen=True, eq=False)
class SectionMap:
    """A map of the template's rectangle to a section of the muscle.

    Attributes
    ----------
    ring, rectangle : (n, k) array, (n, 2) array
        The section's boundary, and the points of the rectangle that go with it [mm].
    split_error : float
        Root of the sum of the four parts' squared errors, as a part of the rectangle's perimeter.
    """

    ring: Floats
    rectangle: Floats
    split_error: float

    def places(self, points: Floats) -> Floats:
        """Return where points (m, 2) of the rectangle are in the section, (m, k) [mm].

        f' = sum_i w_i(f) p_i, with w_i the mean value coordinates of f in the subdivided rectangle and p_i
        the vertices of the section that go with the rectangle's. It may lie outside of a concave section.
        """
        places: Floats = mean_value_weights(self.rectangle, points) @ self.ring
        return places


def section_map(loop: Floats, target: Floats, sides: Floats, *, as_printed: bool) -> SectionMap:
    """Return the map of the template's rectangle to a section of the muscle.

    Parameters
    ----------
    loop : (n, k) array
        The section's boundary, counterclockwise, n >= 3; k is 2, or 3 for a loop in space, of which x and y
        are a view [mm].
    target : (k,) array
        The correspondence starts where the section is nearest to this [mm].
    sides : (2,) array or longer
        Sides of the rectangle [mm].
    as_printed : bool
        Whether it starts at the vertex nearest to the target, and is split at vertices, as in the paper.
        Otherwise vertices are added at both.
    """
    width, depth = float(sides[0]), float(sides[1])
    if as_printed:  # a triangle has too few vertices for four sides, and becomes a hexagon
        ring = rolled_loop(refined_loop(loop, 1 if len(loop) > 3 else 6), target)
    else:
        ring = cornered_loop(refined_loop(loop, N_PLACES), target, width, depth)
    lengths = loop_lengths(ring)
    splits, error = split_chain(lengths, width, depth)
    rectangle = subdivided_rectangle(lengths, splits, width, depth)
    return SectionMap(ring, rectangle, float(np.sqrt(error)) / (2.0 * (width + depth)))


def count_outside(loop: Floats, points: Floats) -> int:
    """Return the number of points (m, 2) outside of a closed loop (n, 2), by the even-odd rule."""
    x, y = points[:, 0, None], points[:, 1, None]
    (bx, by), (ax, ay) = loop[:, :2].T, np.roll(loop[:, :2], 1, axis=0).T
    rises = np.where(by == ay, 1.0, by - ay)
    crossed = ((ay > y) != (by > y)) & ((bx - ax) * (y - ay) / rises + ax > x)
    return int((crossed.sum(axis=1) % 2 == 0).sum())
