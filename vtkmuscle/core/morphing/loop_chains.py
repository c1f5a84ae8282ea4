"""Which loop of each section belongs to the muscle's main branch, and how its course runs."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.morphing.sections import Sections, united
from vtkmuscle.core.types import Floats, Ints


def loop_areas(points: Floats, loop_offsets: Ints) -> Floats:
    """Return the vector area of each loop, (k, 3): half the sum of the cross products of its edges.

    For a flat loop its length is the area, and it points to where the loop runs counterclockwise.
    """
    if len(loop_offsets) == 1:
        return np.empty((0, 3))
    firsts, lasts = loop_offsets[:-1], loop_offsets[1:] - 1
    about = points - np.repeat(points[lasts], lasts + 1 - firsts, axis=0)
    after = np.roll(about, -1, axis=0)
    after[lasts] = 0.0
    areas: Floats = np.add.reduceat(np.cross(about, after), firsts) / 2.0
    return areas


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
    chain: Ints = _largest_chain(sizes, firsts, ends, below, above, thickness)
    if (chain < 0).all():
        raise InputError(
            "", "no section of the muscle through the template has an inside", "fit the template first"
        )
    return chain


def _largest_chain(
    sizes: Floats, firsts: Ints, ends: Ints, below: Ints, above: Ints, thickness: Floats
) -> Ints:
    """Return the loop of each level in the largest chain of loops that continue each other."""
    best, previous = np.zeros(len(sizes)), np.full(len(sizes), -1)
    chain = np.full(len(thickness), -1, dtype=np.int64)
    levels = [range(*span) for span in zip(firsts.tolist(), ends.tolist(), strict=True)]
    for level, loops in enumerate(levels):
        for loop in loops:
            if sizes[loop] <= 0.0:
                continue
            for other in levels[level - 1] if level else ():
                if above[other] == below[loop] and best[other] > best[loop]:
                    best[loop], previous[loop] = best[other], other
            best[loop] += sizes[loop] * thickness[level]
    end = int(best.argmax()) if best.any() else -1
    level = next((number for number, loops in enumerate(levels) if end in loops), -1)
    while end >= 0:
        chain[level] = end
        end, level = int(previous[end]), level - 1
    return chain
