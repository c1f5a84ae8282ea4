"""Attachment areas as surfaces of their own: what a ring of landmarks spans."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vtkmuscle.core.types import Floats, Ints


def discs_over(rings: Sequence[Floats]) -> tuple[Floats, Ints]:
    """Return triangles that span rings, from each ring's mean to its sides.

    On a coarse mesh the triangles between attached points leave out up to an edge's length along the rim of
    an area, and an aponeurosis within a muscle is not on its surface at all: the ring is all that is known.

    Parameters
    ----------
    rings : sequence of (k, 3) arrays
        Boundaries of areas, in order; those of fewer than three points span nothing.

    Returns
    -------
    points : (n, 3) array
        Those of the rings, and the mean of each.
    triangles : (m, 3) int array
        Point ids.
    """
    points, triangles, first = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)], 0
    for ring in rings:
        count = len(ring)
        if count < 3:
            continue
        number = first + np.arange(count)
        triangles.append(np.column_stack([number, np.roll(number, -1), np.full(count, first + count)]))
        points += [ring, ring.mean(axis=0)[None]]
        first += count + 1
    return np.vstack(points), np.vstack(triangles).astype(np.int64)
