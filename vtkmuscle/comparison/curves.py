"""The curves of a muscle in one run or model, and their differences."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.estimate import Estimate, root_of_squares
from vtkmuscle.core.motion.coordinates import ANGLES
from vtkmuscle.core.types import Floats
from vtkmuscle.io.literature import side_apart
from vtkmuscle.opensim.model import OsimModel
from vtkmuscle.opensim.muscle_paths import moment_arm
from vtkmuscle.run.result import Result

#: Millimetres in OpenSim's unit of length.
_MILLIMETRES = 1000.0
#: Quantity of the curves of paths.
LENGTH = "length, bone to bone"


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity of a muscle over a coordinate or the time.

    Attributes
    ----------
    quantity, over, unit : str
        Its name, the name and unit of the horizontal axis, and its own unit.
    x, mean : (n,) array
        Positions on the axis, ascending; the mean of all paths or fibres there.
    error : (n,) array or None
        Of the mean, with 95 % confidence; None where it is not known.
    """

    quantity: str
    over: str
    unit: str
    x: Floats
    mean: Floats
    error: Floats | None = None


def curves_of(result: Result, muscle: str) -> list[Curve]:
    """Return lengths of paths and fibres, and moment arms by each coordinate, of a muscle of a run."""
    known = result.errors.get(muscle, {})
    found = []
    tables = (("length", LENGTH, result.lengths), ("fibre_length", "fibre length", result.fibre_lengths))
    for key, words, table in tables:
        if muscle in table:
            rows = table[muscle]
            x = np.asarray(result.times[: len(rows)], dtype=np.float64)
            found.append(_curve((words, without_side(result.time_label), "mm"), x, rows, known.get(key)))
    arms = result.moment_arms() if result.has_moment_arms else {}
    for name, one in arms[muscle].items() if muscle in arms else ():
        labels = _arm_labels(name, one.unit)
        found.append(_curve(labels, one.values, one.arms, known.get(f"moment_arm_{name}")))
    return found


def _arm_labels(coordinate: str, unit: str) -> tuple[str, str, str]:
    """Return quantity, axis and unit of moment arms by a coordinate."""
    label = side_apart(coordinate).replace("_", " ")
    return f"moment arm, {label}", f"{label} [{unit}]", "mm" if unit in ANGLES else "1"


def curves_of_model(model: OsimModel, muscle: str, result: Result) -> list[Curve]:
    """Return the same of a muscle of OpenSim's, in the poses of a run whose coordinates it has.

    Raises a ValueError if its path winds round surfaces, which is not computed here.
    """
    path, tree = model.muscle(muscle).path, model.tree
    frames, coordinates = list(result.frames), result.motion.coordinates
    values = {
        name: np.asarray(one.values)[frames] * (ANGLES.get(one.unit) or 1.0 / _MILLIMETRES)
        for name, one in coordinates.items()
        if name in tree.free
    }
    if not values:
        raise InputError("", f"the model has none of the run's coordinates {', '.join(coordinates)}")
    lengths = _MILLIMETRES * path.lengths(tree, values)[:, None]
    x = np.asarray(result.times, dtype=np.float64)
    found = [_curve((LENGTH, without_side(result.time_label), "mm"), x, lengths)]
    for name in values:
        one = coordinates[name]
        if one.changes and one.unit in ANGLES:
            arms = _MILLIMETRES * moment_arm(path, tree, values, name)[:, None]
            found.append(_curve(_arm_labels(name, one.unit), np.asarray(one.values)[frames], arms))
    return found


def _curve(labels: tuple[str, str, str], x: Floats, rows: Floats, error: Estimate | None = None) -> Curve:
    order = np.argsort(x, kind="stable")
    total = None if error is None or error.total.shape != x.shape else error.total[order]
    return Curve(*labels, x[order], rows[order].mean(axis=1), total)


def difference(one: Curve, other: Curve) -> Curve | None:
    """Return a curve minus another, at its own positions as far as the other covers them; None if nowhere.

    The error is that of independent errors of both; parts that they share are counted twice.
    """
    inside = (one.x >= other.x[0] - 1e-9) & (one.x <= other.x[-1] + 1e-9)
    if not inside.any():
        return None
    x = one.x[inside]
    error = None
    if one.error is not None and other.error is not None:
        error = root_of_squares(one.error[inside], np.interp(x, other.x, other.error))
    return replace(one, x=x, mean=one.mean[inside] - np.interp(x, other.x, other.mean), error=error)


def figures_of(apart: Curve) -> tuple[float | None, ...]:
    """Return mean, root mean square, largest value and its position, and error of a difference."""
    worst = int(np.abs(apart.mean).argmax())
    largest = float(apart.mean[worst]), float(apart.x[worst])
    return float(apart.mean.mean()), mean_square_root(apart.mean), *largest, mean_square_root(apart.error)


def without_side(label: str) -> str:
    """Return the label of an axis without a side: ``hip flexion [deg]`` of ``hip flexion r [deg]``."""
    name, bracket, unit = label.partition(" [")
    return side_apart(name.replace(" ", "_")).replace("_", " ") + bracket + unit


def mean_square_root(values: Floats | None) -> float | None:
    """Return the root of the mean of the squares, None of None."""
    return None if values is None else math.sqrt(float(np.mean(np.square(values))))
