"""How far the length of a polyline may be off by its segments."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.accuracy.convergence import convergence_error_of_fine
from vtkmuscle.core.mesh.polylines import polyline_lengths
from vtkmuscle.core.types import Floats, Ints

#: Chords are shorter than arcs by the square of the segments' length.
CHORD_ORDER = 2.0


def segment_errors(points: Floats, offsets: Ints) -> Floats:
    """Return by how much polylines are shorter than the curves that they stand for.

    The length by every second point is compared with that by all of them, see
    :func:`~vtkmuscle.core.accuracy.convergence.convergence_error_of_fine`.

    Parameters
    ----------
    points, offsets : (n, 3) array, (k + 1,) int array
        Positions [mm]; first point of each line, and n.

    Returns
    -------
    (k,) array
        Expanded uncertainty of the lengths [mm].

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.accuracy.polylines import segment_errors
    >>> turn = np.linspace(0.0, np.pi / 2.0, 9)
    >>> arc = 100.0 * np.column_stack([np.cos(turn), np.sin(turn), 0.0 * turn])
    >>> float(50.0 * np.pi - 8 * 200.0 * np.sin(np.pi / 32.0))  # arc less chords
    0.252...
    >>> segment_errors(arc, np.array([0, 9])).round(2)
    array([0.76])
    """
    fine = polyline_lengths(points, offsets)
    return convergence_error_of_fine(_every_second(points, offsets), fine, order=CHORD_ORDER)


def _every_second(points: Floats, offsets: Ints) -> Floats:
    """Return the lengths (k,) by every second point and the last one."""
    counts = np.diff(offsets)
    place = np.arange(len(points)) - np.repeat(offsets[:-1], counts)
    kept = (place % 2 == 0) | (place == np.repeat(counts, counts) - 1)
    firsts = np.concatenate([[0], np.cumsum(kept)])[offsets]
    return polyline_lengths(points[kept], firsts)
