"""Functions of one coordinate: how far a joint turns or slides, and where a point of a path is.

They are those of OpenSim's models, with its conventions at the ends of splines, and its files.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Protocol
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.io.xml_elements import Element, made


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
class Knots:
    """A curve through knots that goes on straight beyond them.

    Parameters
    ----------
    x, y : (n,) array_like
        Two knots or more, x ascending.
    """

    x: Floats
    y: Floats
    _curve: Any = field(init=False, repr=False)
    _what: ClassVar[str]

    def __post_init__(self) -> None:
        what = self._what
        x, y = (_check(f"{what}'s {name}", getattr(self, name)) for name in "xy")
        if len(x) != len(y) or len(x) < 2:
            problem = f"{what} has {len(x)} x and {len(y)} y, but needs as many of each, two or more"
            raise InputError("", problem)
        if (np.diff(x) <= 0.0).any():
            raise InputError("", f"the x of {what} must ascend")
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                curve = self._through(x, y)
            good = np.isfinite(curve.c).all()
        except (ValueError, np.linalg.LinAlgError):
            good = False
        if not good:
            raise InputError("", f"the knots of {what} are too close, or too far apart")
        for name, value in (("x", x), ("y", y), ("_curve", curve)):
            object.__setattr__(self, name, value)

    @staticmethod
    def _through(x: Floats, y: Floats) -> Any:
        return make_interp_spline(x, y, k=1)

    def __call__(self, values: Floats) -> Floats:
        """Return the function at each value."""
        inside = np.clip(values, self.x[0], self.x[-1])
        result: Floats = self._curve(inside) + (values - inside) * self._curve(inside, 1)
        return result


class PiecewiseLinear(Knots):
    """Straight lines between knots, the first and the last of them going on."""

    _what = "a piecewise linear function"


class CubicSpline(Knots):
    """A cubic spline through knots that goes on straight beyond them: OpenSim's SimmSpline.

    At either end the third derivative is that of the cubic through the four outermost knots (Forsythe,
    Malcolm, Moler 1977, *Computer methods for mathematical computations*, section 4.4), or, of three knots,
    zero.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.opensim.functions import CubicSpline
    >>> x = np.array([0.0, 1.0, 2.5, 3.0, 4.0])
    >>> CubicSpline(x, x**3)(np.array([2.0, 3.5])).round(9).tolist()
    [8.0, 42.875]
    """

    _what = "a spline"

    @staticmethod
    def _through(x: Floats, y: Floats) -> Any:
        if len(x) == 2:
            return make_interp_spline(x, y, k=1)
        ends = (slice(4), slice(-4, None)) if len(x) > 3 else ()
        thirds = [make_interp_spline(x[end], y[end], k=3)(x[end][0], 3) for end in ends] or [0.0, 0.0]
        return make_interp_spline(x, y, k=3, bc_type=tuple([(3, third)] for third in thirds))


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
        return self.amplitude * np.sin(self.omega * values + self.phase) + self.offset


def _check(what: str, numbers: ArrayLike) -> Floats:
    values = np.array(numbers, dtype=np.float64)
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
        raise InputError("", f"{what} is made of finite numbers, one or more")
    values.setflags(write=False)
    return values


def stretched(function: CoordinateFunction, factor: float) -> CoordinateFunction:
    """Return the function of q that is f(q / factor), of the same kind as f.

    Raises
    ------
    InputError
        For a function of another kind than those here.
    """
    match function:
        case Constant():
            return function
        case Polynomial(coefficients):
            return Polynomial(coefficients / factor ** np.arange(len(coefficients))[::-1])
        case Knots(x, y):
            return type(function)(factor * x, y)
        case Wave():
            return replace(function, omega=function.omega / factor)
        case Multiplier(inner, times):
            return Multiplier(stretched(inner, factor), times)
    raise InputError("", f"a function of the kind {type(function).__name__} cannot be stretched")


#: The coordinate itself.
IDENTITY = Polynomial(np.array([1.0, 0.0]))


#: Tags of the functions that are understood.
FUNCTIONS = (
    *("Constant", "LinearFunction", "PolynomialFunction", "SimmSpline", "NaturalCubicSpline"),
    *("natCubicSpline", "PiecewiseLinearFunction", "MultiplierFunction", "Sine"),
)
#: Numbers of a sine, and what they are where a file does not give them.
_SINE = {"amplitude": 1.0, "omega": 1.0, "phase": 0.0, "offset": 0.0}


def function_in(holder: Element) -> CoordinateFunction:
    """Return the function that an element of OpenSim's files holds.

    Raises
    ------
    InputError
        If it holds none, several, or one that is not understood.
    """
    children = [child for child in holder.children if child.tag != "default"]
    if len(children) != 1:
        raise holder.error(f"must hold one function, but holds {len(children)} elements")
    (element,) = children
    if element.tag not in FUNCTIONS:
        raise element.error("this function is not understood", f"understood: {', '.join(FUNCTIONS)}")
    try:
        return _function(element)
    except ValueError as error:
        raise element.placed(error) from error


def _function(element: Element) -> CoordinateFunction:
    match element.tag:
        case "Constant":
            element.only(("value",))
            return Constant(element.number("value", 0.0))
        case "LinearFunction" | "PolynomialFunction":
            element.only(("coefficients",))
            count = 2 if element.tag == "LinearFunction" else None
            return Polynomial(element.need("coefficients").numbers(count))
        case "MultiplierFunction":
            element.only(("function", "scale", *FUNCTIONS))
            inner = element.find("function")
            if inner is None:
                bare = [child for child in element.children if child.tag in FUNCTIONS]
                inner = replace(element, tag="function", attributes={}, children=bare)
            return Multiplier(function_in(inner), element.number("scale", 1.0))
        case "Sine":
            element.only(tuple(_SINE))
            return Wave(*(element.number(name, default) for name, default in _SINE.items()))
    element.only(("x", "y"))
    kind = PiecewiseLinear if element.tag == "PiecewiseLinearFunction" else CubicSpline
    return kind(element.need("x").numbers(), element.need("y").numbers())


def function_element(function: CoordinateFunction, **attributes: str) -> ElementTree.Element:
    """Return a function as OpenSim's files have it.

    Raises
    ------
    InputError
        For a function of another kind than those here.
    """
    match function:
        case Multiplier(inner, factor):
            held = made("function", function_element(inner))
            return made("MultiplierFunction", held, made("scale", factor), **attributes)
        case Constant(value):
            return made("Constant", made("value", value), **attributes)
        case Polynomial(coefficients):
            kind = "LinearFunction" if len(coefficients) == 2 else "PolynomialFunction"
            return made(kind, made("coefficients", coefficients), **attributes)
        case Wave():
            return made("Sine", *(made(name, getattr(function, name)) for name in _SINE), **attributes)
        case Knots(x, y):
            kind = "SimmSpline" if isinstance(function, CubicSpline) else "PiecewiseLinearFunction"
            return made(kind, made("x", x), made("y", y), **attributes)
    raise InputError("", f"OpenSim has no function like {type(function).__name__}")
