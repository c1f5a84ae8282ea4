"""Places in an order in which neighbours in space are neighbours in memory."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import Floats, Ints

#: Halvings of the longest side of the box around the places.
HALVINGS = 7


def space_order(places: Floats) -> Ints:
    """Return the order of places along a curve that goes through a box by halves, halves of halves and so on.

    That is the Z-order of Morton 1966, *A computer oriented geodetic data base and a new technique in file
    sequencing*. What is looked up for a place is then mostly at hand from the one before.

    Parameters
    ----------
    places : (n, d) array
        Positions, n >= 1, finite.

    Returns
    -------
    (n,) int array
        Numbers of the places; those in the same cell of the box as they come.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.space_order import space_order
    >>> space_order(np.array([[0.0, 0.0], [1.0, 1.0], [0.1, 0.0], [0.9, 1.0]])).tolist()
    [0, 2, 3, 1]
    """
    size = max(float(np.ptp(places, axis=0).max()), 1e-300)
    cells = ((places - places.min(axis=0)) * (2**HALVINGS / size)).astype(np.int64)
    cells = np.minimum(cells, 2**HALVINGS - 1)
    dimensions = cells.shape[1]
    digits = np.arange(HALVINGS)
    # Of each number of a cell its binary digits, as far apart as there are dimensions.
    apart = ((np.arange(2**HALVINGS)[:, None] >> digits & 1) << dimensions * digits).sum(axis=1)
    codes = (apart[cells] << np.arange(dimensions)).sum(axis=1)
    return np.argsort(codes, kind="stable")
