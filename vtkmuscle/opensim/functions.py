"""Functions of one coordinate: how far a joint turns or slides, and where a point of a path is.

They are those of OpenSim's models, with its conventions at the ends of splines.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_banded

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats


class CoordinateFunction(Protocol):
    """A function of one coordinate, for many values at once."""

    def __call__(self, values: Floats) -> Floats:
        """Return the function (f,) of values (f,)."""
        ...


@dataclass(frozen=True)
class Constant:
    """The same number everywhere.

    Parameters
    ----------
    value : float
        The number.
    """

    value: float

    def __post_init__(self) -> None:
        _check("a constant", [self.value])

    def __call__(self, values: Floats) -> Floats:
        """Return the number for each value."""
        return np.full(np.shape(values), self.value)


@dataclass(frozen=True, eq=False)
class Polynomial:
    """A polynomial; a straight line where it has two coefficients.

    Parameters
    ----------
    coefficients : (n,) array_like
        Highest power first.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.opensim.functions import Polynomial
    >>> Polynomial([2.0, 0.5])(np.array([0.0, 1.0])).tolist()
    [0.5, 2.5]
    """

    coefficients: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", _check("a polynomial", self.coefficients))

    def __call__(self, values: Floats) -> Floats:
        """Return the polynomial at each value."""
        result = np.polyval(self.coefficients, np.asarray(values, dtype=np.float64))
        return np.asarray(result, dtype=np.float64)


@dataclass(frozen=True, eq=False)
class PiecewiseLinear:
    """Straight lines between knots, the first and the last of them going on.

    Parameters
    ----------
    x, y : (n,) array_like
        Two knots or more, x ascending.
    """

    x: Floats
    y: Floats

    def __post_init__(self) -> None:
        _set_knots(self, "a piecewise linear function")

    def __call__(self, values: Floats) -> Floats:
        """Return the function at each value."""
        piece = np.clip(np.searchsorted(self.x, values, side="right") - 1, 0, len(self.x) - 2)
        slope = np.diff(self.y) / np.diff(self.x)
        result: Floats = self.y[piece] + slope[piece] * (values - self.x[piece])
        return result


@dataclass(frozen=True, eq=False)
class CubicSpline:
    """A cubic spline through knots that goes on straight beyond them: OpenSim's SimmSpline.

    At either end the third derivative is that of the cubic through the four outermost knots (Forsythe,
    Malcolm, Moler 1977, *Computer methods for mathematical computations*, section 4.4), or, of three knots,
    the same on both sides of the inner one.

    Parameters
    ----------
    x, y : (n,) array_like
        Two knots or more, x ascending.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.opensim.functions import CubicSpline
    >>> x = np.array([0.0, 1.0, 2.5, 3.0, 4.0])
    >>> CubicSpline(x, x**3)(np.array([2.0, 3.5])).round(9).tolist()
    [8.0, 42.875]
    """

    x: Floats
    y: Floats
    _curvature: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        _set_knots(self, "a spline")
        object.__setattr__(self, "_curvature", _sixths(self.x, self.y))

    def __call__(self, values: Floats) -> Floats:
        """Return the spline at each value."""
        x, y, c = self.x, self.y, self._curvature
        piece = np.clip(np.searchsorted(x, values, side="right") - 1, 0, len(x) - 2)
        h = np.diff(x)[piece]
        slope = (y[piece + 1] - y[piece]) / h - h * (c[piece + 1] + 2.0 * c[piece])
        t = np.clip(values, x[0], x[-1]) - x[piece]
        inside = y[piece] + t * (slope + t * (3.0 * c[piece] + t * (c[piece + 1] - c[piece]) / h))
        last = (y[-1] - y[-2]) / (x[-1] - x[-2]) + (x[-1] - x[-2]) * (c[-2] + 2.0 * c[-1])
        first = (y[1] - y[0]) / (x[1] - x[0]) - (x[1] - x[0]) * (c[1] + 2.0 * c[0])
        beyond = np.minimum(values - x[0], 0.0) * first + np.maximum(values - x[-1], 0.0) * last
        result: Floats = inside + beyond
        return result


@dataclass(frozen=True)
class Multiplier:
    """A function times a number.

    Parameters
    ----------
    function : CoordinateFunction
        Of a coordinate.
    factor : float
        The number.
    """

    function: CoordinateFunction
    factor: float

    def __post_init__(self) -> None:
        _check("a factor", [self.factor])

    def __call__(self, values: Floats) -> Floats:
        """Return the function times the number at each value."""
        return self.factor * self.function(values)


@dataclass(frozen=True)
class Wave:
    """A sine: amplitude * sin(omega * q + phase) + offset.

    Parameters
    ----------
    amplitude, omega, phase, offset : float
        As in the formula.
    """

    amplitude: float
    omega: float = 1.0
    phase: float = 0.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        _check("a sine", [self.amplitude, self.omega, self.phase, self.offset])

    def __call__(self, values: Floats) -> Floats:
        """Return the sine at each value."""
        result: Floats = self.amplitude * np.sin(self.omega * values + self.phase) + self.offset
        return result


def _check(what: str, numbers: ArrayLike) -> Floats:
    values = np.array(numbers, dtype=np.float64)
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
        raise InputError("", f"{what} is made of finite numbers, one or more")
    values.setflags(write=False)
    return values


def _set_knots(function: PiecewiseLinear | CubicSpline, what: str) -> None:
    x, y = (_check(f"{what}'s {name}", getattr(function, name)) for name in "xy")
    if len(x) != len(y) or len(x) < 2:
        raise InputError("", f"{what} has {len(x)} x and {len(y)} y, but needs as many of each, two or more")
    if (np.diff(x) <= 0.0).any():
        raise InputError("", f"the x of {what} must ascend")
    object.__setattr__(function, "x", x)
    object.__setattr__(function, "y", y)


def _sixths(x: Floats, y: Floats) -> Floats:
    """Return a sixth of the second derivative at each knot."""
    n = len(x)
    if n == 2:
        return np.zeros(2)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        sixths = _solved(x, y, n)
    if not np.isfinite(sixths).all():
        raise InputError("", "the knots of a spline are too close, or too far apart")
    return sixths


def _solved(x: Floats, y: Floats, n: int) -> Floats:
    h = np.diff(x)
    slopes = np.diff(y) / h
    bands = np.zeros((3, n))
    bands[0, 1:], bands[2, :-1] = h, h
    bands[1, 1:-1] = 2.0 * (h[:-1] + h[1:])
    bands[1, [0, -1]] = -h[0], -h[-1]
    right = np.zeros(n)
    right[1:-1] = np.diff(slopes)
    if n > 3:
        seconds = np.diff(slopes) / (x[2:] - x[:-2])  # divided differences
        right[0] = h[0] ** 2 * (seconds[1] - seconds[0]) / (x[3] - x[0])
        right[-1] = -(h[-1] ** 2) * (seconds[-1] - seconds[-2]) / (x[-1] - x[-4])
    result: Floats = solve_banded((1, 1), bands, right, check_finite=False)
    return result


#: The coordinate itself.
IDENTITY = Polynomial(np.array([1.0, 0.0]))
