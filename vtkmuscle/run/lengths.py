"""Tables of lengths: of the paths of muscles, and of their fibres."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.types import Floats
from vtkmuscle.run.table import Table

#: Columns of both tables: a row per muscle, fibre and frame; a path has the number of its fibre.
COLUMNS = ("muscle", "fibre", "frame", "time", "length_mm", "length_err_mm")


def length_table(
    lengths: Mapping[str, Floats],
    errors: Mapping[str, Mapping[str, Estimate]],
    quantity: str,
    frames: Sequence[int],
    times: Sequence[float],
) -> Table:
    """Return lengths as a table.

    Parameters
    ----------
    lengths : mapping of str to (f, k) array
        Per muscle, in the first f of the frames [mm].
    errors : mapping of str to mapping of str to Estimate
        What is known of the errors of each muscle.
    quantity : str
        ``"each_length"`` or ``"each_fibre_length"``: what is known of the lengths' errors.
    frames, times : sequences
        Numbers and times of the frames.
    """
    known = {name: errors[name].get(quantity) for name in lengths}
    totals = {
        name: np.full(one.shape, np.nan) if (found := known[name]) is None else found.total
        for name, one in lengths.items()
    }
    return Table(
        COLUMNS,
        (
            (name, fibre, frame, time, length, error)
            for name, one in lengths.items()
            for fibre, (curve, error_of) in enumerate(zip(one.T, totals[name].T, strict=True))
            for frame, time, length, error in zip(frames, times, curve, error_of, strict=False)
        ),
    )
