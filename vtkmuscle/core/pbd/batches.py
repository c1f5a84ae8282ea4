"""The order of a surface's edges: rows of edges that share no point, whose constraints are solved at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import Bools, Ints

#: Edges of a row: two vectors of eight numbers, or four of four.
WIDTH = 16


def rows_of_edges(points_of_edges: Ints, n_points: int) -> NDArray[np.int64]:
    """Return the numbers of edges in rows (r, WIDTH), -1 where a row has a place left.

    Edges of a row share none of their points (k, 4), the ends of each and the third points of its triangles;
    a negative number is no point. Each edge gets the first colour that none of its points has; colours are
    cut into rows. To solve the constraints of a row at once is to solve them one after another.
    """
    colours = np.empty(len(points_of_edges), dtype=np.int64)
    size = 64
    while True:
        taken = np.zeros((n_points, size), dtype=np.bool_)
        if _first_fit(points_of_edges, taken, colours):
            break
        size *= 2
    order = np.argsort(colours, kind="stable")
    rows = []
    for colour in np.split(order, np.flatnonzero(np.diff(colours[order])) + 1):
        room = np.full(-len(colour) % WIDTH, -1)
        rows.append(np.concatenate([colour, room]).reshape(-1, WIDTH))
    return np.concatenate(rows)


@kernel
def _first_fit(points_of_edges: Ints, taken: Bools, colours: Ints) -> bool:
    """Write the colour of each edge; return False where there are too few colours.

    taken : (n, c), changed in place: whether an edge of a point has a colour.
    """
    for e in range(len(points_of_edges)):
        colour, most = 0, taken.shape[1]
        while colour < most:
            clear = True
            for k in range(4):
                i = points_of_edges[e, k]
                clear = clear and (i < 0 or not taken[i, colour])
            if clear:
                break
            colour += 1
        if colour == most:
            return False
        colours[e] = colour
        for k in range(4):
            if points_of_edges[e, k] >= 0:
                taken[points_of_edges[e, k], colour] = True
    return True
