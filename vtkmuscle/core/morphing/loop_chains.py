"""Which loop of each section belongs to the muscle's main branch, and how its course runs."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.jit import array_kernel
from vtkmuscle.core.morphing.sections import Sections, united
from vtkmuscle.core.types import Floats, Ints


@array_kernel
def loop_areas(points: Floats, loop_offsets: Ints) -> Floats:
    """Return the vector area of each loop, (k, 3): half the sum of the cross products of its edges.

    For a flat loop its length is the area, and it points to where the loop runs counterclockwise.
    """
    result = np.zeros((len(loop_offsets) - 1, 3))
    for loop in range(len(result)):
        first, last = loop_offsets[loop], loop_offsets[loop + 1] - 1
        x, y, z = points[last]
        for i in range(first, last - 1):
            ax, ay, az = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
            bx, by, bz = points[i + 1, 0] - x, points[i + 1, 1] - y, points[i + 1, 2] - z
            result[loop, 0] += 0.5 * (ay * bz - az * by)
            result[loop, 1] += 0.5 * (az * bx - ax * bz)
            result[loop, 2] += 0.5 * (ax * by - ay * bx)
    return result


def main_loops(sections: Sections, levels: Floats, sizes: Floats, chosen: Ints | None = None) -> Ints:
    """Return the loop of each level that belongs to the muscle's main branch, -1 beyond its ends.

    A loop continues another one of the next level if the surface between the two levels joins them. Of all
    chains of loops that continue each other the one is taken that encloses most (area times distance of
    the levels): so it never changes from one branch to another one that it does not meet.

    Parameters
    ----------
    sections : Sections
        Of the muscle.
    levels : (l,) array
        Heights, strictly ascending [mm].
    sizes : (k,) array
        Area of each loop [mm^2]; loops of 0 or less, as the boundaries of holes, take no part.
    chosen : (c,) int array, optional
        Numbers of the levels to follow the branch along, ascending, as if there were no others; default all.

    Returns
    -------
    (c,) int array
        Numbers of loops; the levels of those that are not -1 follow each other.

    Raises
    ------
    ValueError
        If no level has a loop with an inside.
    """
    below, above, offsets = sections.parts_below, sections.parts_above, sections.level_offsets
    firsts, ends = offsets[:-1], offsets[1:]
    if chosen is not None:
        level_of = np.repeat(np.arange(len(levels)), np.diff(offsets))
        below, above = united(below, above, np.flatnonzero(~np.isin(level_of, chosen)))
        levels, firsts, ends = levels[chosen], firsts[chosen], ends[chosen]
    thickness = np.gradient(levels) if len(levels) > 1 else np.ones(1)
    chain: Ints = _largest_chain(np.ascontiguousarray(sizes), firsts, ends, below, above, thickness)
    if (chain < 0).all():
        raise InputError(
            "", "no section of the muscle through the template has an inside", "fit the template first"
        )
    return chain


@array_kernel
def _largest_chain(
    sizes: Floats, firsts: Ints, ends: Ints, below: Ints, above: Ints, thickness: Floats
) -> Ints:
    """Return the chain of loops that encloses the largest volume, by dynamic programming."""
    n_loops = len(sizes)
    best = np.zeros(n_loops)
    previous = np.full(n_loops, -1, dtype=np.int64)
    chain = np.full(len(thickness), -1, dtype=np.int64)
    end, end_level = -1, -1
    for level in range(len(thickness)):
        for loop in range(firsts[level], ends[level]):
            if sizes[loop] <= 0.0:
                continue
            if level > 0:
                for other in range(firsts[level - 1], ends[level - 1]):
                    if above[other] == below[loop] and best[other] > best[loop]:
                        best[loop] = best[other]
                        previous[loop] = other
            best[loop] += sizes[loop] * thickness[level]
            if end < 0 or best[loop] > best[end]:
                end, end_level = loop, level
    while end >= 0:
        chain[end_level] = end
        end, end_level = previous[end], end_level - 1
    return chain
