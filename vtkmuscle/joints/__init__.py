"""Joints: trees of bodies on joints, OpenSim files, and coordinate grids."""

from collections.abc import Mapping

import numpy as np

from vtkmuscle.core.types import Floats


def steps_of(start: float, stop: float, step: float) -> Floats:
    """Return values from start to stop, stop included.

    Examples
    --------
    >>> from vtkmuscle.joints import steps_of
    >>> steps_of(0.0, 5.0, 2.0).tolist()
    [0.0, 2.0, 4.0, 5.0]
    """
    # A whole number of steps, up to rounding, ends at stop.
    return np.append(start + step * np.arange(int(np.ceil((stop - start) / step - 1e-9))), stop)


def grid_of(axes: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return all poses (f,) of a grid of coordinates.

    Coordinates (k,) by name. Consecutive poses are neighbours on the grid: the last coordinate changes
    first, to and fro in turn, so no step is longer than a grid step.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.joints import grid_of
    >>> found = grid_of({"hip": np.array([0.0, 1.0]), "knee": np.array([0.0, 1.0, 2.0])})
    >>> found["knee"].tolist()
    [0.0, 1.0, 2.0, 2.0, 1.0, 0.0]
    """
    sizes = [len(values) for values in axes.values()]
    rows = np.indices(sizes).reshape(len(sizes), -1).T
    for column in range(1, len(sizes)):
        # A coordinate goes to and fro by the number of turns of the coordinates before.
        back = (np.arange(len(rows)) // int(np.prod(sizes[column:]))) % 2 == 1
        rows[back, column] = sizes[column] - 1 - rows[back, column]
    return {name: values[rows[:, column]] for column, (name, values) in enumerate(axes.items())}
