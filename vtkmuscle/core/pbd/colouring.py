"""Colours for constraints, so that no two of one colour share a point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import Ints

Bits = NDArray[np.uint64]

#: Colours that are told apart by the bits of one word; constraints beyond them take rising numbers.
WORD = 64


def greedy_colouring(constraints: Ints, n_points: int, *, block: int | None = None) -> Ints:
    """Give each constraint the first colour that none of its points has yet.

    Constraints of one colour share no point, so they can be projected side by side, and the result is that
    of projecting them one after the other: Gauss-Seidel in the order of the colours. Fratarcangeli, Tibaldo,
    Pellacini 2016, *Vivace: a practical Gauss-Seidel method for stable soft body dynamics*,
    doi:10.1145/2980179.2982437.

    Parameters
    ----------
    constraints : (m, k) int array
        Point ids of each constraint. Ids of ``n_points`` and above stand for no point and clash with none.
    n_points : int
        Number of points.
    block : int, optional
        Colour every so many constraints anew, with colours of their own, so that the points of a colour lie
        near each other in memory where the constraints do. All together by default.

    Returns
    -------
    (m,) int array
        Colours from 0 up; those of a block are all above those of the block before it.

    Examples
    --------
    >>> import numpy as np
    >>> greedy_colouring(np.array([[0, 1], [1, 2], [2, 3], [3, 0]]), 4)
    array([0, 1, 0, 1])
    """
    colours = np.empty(len(constraints), dtype=np.int64)
    if len(constraints):
        size = len(constraints) if block is None else block
        used = np.zeros(n_points + 1, dtype=np.uint64)
        above = np.zeros(n_points + 1, dtype=np.int64)
        _colour(np.minimum(constraints, n_points), size, used, above, colours)
    return colours


@kernel
def _colour(constraints: Ints, block: int, used: Bits, above: Ints, colours: Ints) -> None:
    """First-fit colouring; ``used`` holds one bit per colour of each point, ``above`` its next free one.

    A point of more than 64 constraints runs out of bits. Its further constraints take the least number that
    is above all numbers of their points: not the fewest colours, but no more work per constraint either.
    """
    n = len(used) - 1
    one = np.uint64(1)
    first = 0
    for start in range(0, len(constraints), block):
        rows = constraints[start : start + block]
        for i in range(len(used)):
            used[i] = np.uint64(0)
            above[i] = WORD
        last = 0
        for row in range(len(rows)):
            taken = np.uint64(0)
            for point in rows[row]:
                if point < n:
                    taken |= used[point]
            colour = 0
            while colour < WORD and (taken >> np.uint64(colour)) & one:
                colour += 1
            if colour == WORD:
                for point in rows[row]:
                    if point < n:
                        colour = max(colour, above[point])
                for point in rows[row]:
                    above[point] = colour + 1
            else:
                for point in rows[row]:
                    used[point] |= one << np.uint64(colour)
            colours[start + row] = first + colour
            last = max(last, colour)
        first += last + 1
