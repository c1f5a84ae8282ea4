"""The curves of a muscle in one run or model, and by how much two differ."""

from __future__ import annotations

import math
from dataclasses import dataclass

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


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity of a muscle over a coordinate or the time.

    Attributes
    ----------
    quantity, over, unit : str
        What it is, over what with its unit, and its own unit.
    x, mean, low, high : (n,) array
        Where, ascending; the mean of all paths or fibres there, the least and the largest.
    error : (n,) array or None
        Of the mean, with 95 % confidence, where it is known.
    """

    quantity: str
    over: str
    unit: str
    x: Floats
    mean: Floats
    low: Floats
    high: Floats
    error: Floats | None = None


@dataclass(frozen=True, eq=False)
class Difference:
    """By how much a curve is above another, where both are.

    Attributes
    ----------
    x, values : (n,) array
        Where, and the difference of the means there.
    error : (n,) array or None
        Of the difference, as if the errors of both were independent; what they share is counted twice.
    """

    x: Floats
    values: Floats
    error: Floats | None

    @property
    def figures(self) -> tuple[float | None, ...]:
        """Its mean, root mean square, largest value and where that is, and the same root of its error."""
        worst = int(np.abs(self.values).argmax())
        largest = float(self.values[worst]), float(self.x[worst])
        root, error = mean_square_root(self.values), mean_square_root(self.error)
        return float(self.values.mean()), root, *largest, error


def curves_of(result: Result, muscle: str) -> list[Curve]:
    """Return lengths of paths and fibres, and moment arms by each coordinate, of a muscle of a run."""
    known = result.errors.get(muscle, {})
    found = []
    for what, table in (("length", result.lengths), ("fibre_length", result.fibre_lengths)):
        if muscle in table:
            rows = table[muscle]
            words = "length, bone to bone" if what == "length" else "fibre length"
            x = np.asarray(result.times[: len(rows)], dtype=np.float64)
            found.append(_curve(words, side_apart_label(result.time_label), "mm", x, rows, known.get(what)))
    arms = result.moment_arms() if result.has_moment_arms else {}
    for name, one in arms[muscle].items() if muscle in arms else ():
        label, unit = side_apart(name).replace("_", " "), "mm" if one.unit in ANGLES else "1"
        error = known.get(f"moment_arm_{name}")
        found.append(
            _curve(f"moment arm, {label}", f"{label} [{one.unit}]", unit, one.values, one.arms, error)
        )
    return found


def curves_of_model(model: OsimModel, muscle: str, result: Result) -> list[Curve]:
    """Return the same of a muscle of OpenSim's, in the poses of a run whose coordinates it has.

    Raises
    ------
    ValueError
        If its path winds round surfaces, which is not computed here.
    """
    path, tree = model.muscle(muscle).path, model.tree
    frames = list(result.frames)
    values: dict[str, Floats] = {}
    for name, one in result.motion.coordinates.items():
        if name in tree.free:
            values[name] = np.asarray(one.values)[frames] * (ANGLES.get(one.unit) or 1.0 / _MILLIMETRES)
    if not values:
        raise InputError(
            "", f"the model has none of the run's coordinates {', '.join(result.motion.coordinates)}"
        )
    lengths = _MILLIMETRES * path.lengths(tree, values)[:, None]
    x = np.asarray(result.times, dtype=np.float64)
    found = [_curve("length, bone to bone", side_apart_label(result.time_label), "mm", x, lengths, None)]
    for name in values:
        one = result.motion.coordinates[name]
        label = side_apart(name).replace("_", " ")
        if one.changes and one.unit in ANGLES:
            arms = _MILLIMETRES * moment_arm(path, tree, values, name)[:, None]
            x = np.asarray(one.values)[frames]
            found.append(_curve(f"moment arm, {label}", f"{label} [{one.unit}]", "mm", x, arms, None))
    return found


def difference(one: Curve, other: Curve) -> Difference | None:
    """Return by how much a curve is above another one, at its own places; None where they do not overlap."""
    inside = (one.x >= other.x[0] - 1e-9) & (one.x <= other.x[-1] + 1e-9)
    if not inside.any():
        return None
    x = one.x[inside]
    error = None
    if one.error is not None and other.error is not None:
        error = root_of_squares(one.error[inside], np.interp(x, other.x, other.error))
    return Difference(x, one.mean[inside] - np.interp(x, other.x, other.mean), error)


def side_apart_label(label: str) -> str:
    """Return what times are, without a side: ``hip flexion [deg]`` of ``hip flexion r [deg]``."""
    name, bracket, unit = label.partition(" [")
    return side_apart(name.replace(" ", "_")).replace("_", " ") + bracket + unit


def mean_square_root(values: Floats | None) -> float | None:
    """Return the root of the mean of the squares; None where nothing is known."""
    return None if values is None else math.sqrt(float(np.mean(np.square(values))))


def _curve(quantity: str, over: str, unit: str, x: Floats, rows: Floats, error: Estimate | None) -> Curve:
    order = np.argsort(x, kind="stable")
    total = None if error is None or error.total.shape != x.shape else error.total[order]
    rows = rows[order]
    return Curve(quantity, over, unit, x[order], rows.mean(axis=1), rows.min(axis=1), rows.max(axis=1), total)
