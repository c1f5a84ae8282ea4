"""Functions of a single coordinate with OpenSim's conventions, read from and written to its files."""

from dataclasses import dataclass, field, replace
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.data import toml_table
from vtkmuscle.io.xml_elements import Element, made


@dataclass(frozen=True, eq=False)
class Polynomial:
    """A polynomial with coefficients (n,), from the highest power to the constant.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.joints.functions import Polynomial
    >>> Polynomial([2.0, 0.5])(np.array([0.0, 1.0])).tolist()
    [0.5, 2.5]
    """

    coefficients: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", _checked("a polynomial", self.coefficients))

    def __call__(self, values: Floats) -> Floats:
        """Return the polynomial at each value."""
        return np.asarray(np.polyval(self.coefficients, np.asarray(values, dtype=np.float64)))

    def rescaled(self, x: float, y: float) -> "Polynomial":
        """Return the function y f(q / x) of q."""
        return Polynomial(y * self.coefficients / x ** np.arange(len(self.coefficients))[::-1])


@dataclass(frozen=True, eq=False)
class Knots:
    """A curve through 2 knots (x, y) or more, straight beyond the ends."""

    x: Floats
    y: Floats
    _curve: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        x, y = _checked("x of knots", self.x), _checked("y of knots", self.y)
        if len(x) != len(y) or len(x) < 2:
            raise InputError("", f"a curve has {len(x)} x and {len(y)} y, but needs as many of each, from 2")
        if (np.diff(x) <= 0.0).any():
            raise InputError("", "the x of a curve's knots must ascend")
        apart = InputError("", "the knots of a curve are too close, or too far apart")
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                curve = self._through(x, y)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise apart from error
        if not np.isfinite(curve.c).all():
            raise apart
        for name, value in (("x", x), ("y", y), ("_curve", curve)):
            object.__setattr__(self, name, value)

    @staticmethod
    def _through(x: Floats, y: Floats) -> Any:
        return _spline(x, y, k=1)

    def __call__(self, values: Floats) -> Floats:
        """Return the function at each value."""
        inside = np.clip(values, self.x[0], self.x[-1])
        return np.asarray(self._curve(inside) + (values - inside) * self._curve(inside, 1))

    def rescaled(self, x: float, y: float) -> "Knots":
        """Return the function y f(q / x) of q, for x > 0."""
        return type(self)(x * self.x, y * self.y)


class PiecewiseLinear(Knots):
    """Straight lines between knots, extended at both ends."""


class CubicSpline(Knots):
    """A cubic spline through knots, straight beyond them: OpenSim's SimmSpline.

    At either end the third derivative is that of the cubic through the four outermost knots (Forsythe,
    Malcolm, Moler 1977, *Computer methods for mathematical computations*, section 4.4), or, for three knots,
    zero.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.joints.functions import CubicSpline
    >>> x = np.array([0.0, 1.0, 2.5, 3.0, 4.0])
    >>> CubicSpline(x, x**3)(np.array([2.0, 3.5])).round(9).tolist()
    [8.0, 42.875]
    """

    @staticmethod
    def _through(x: Floats, y: Floats) -> Any:
        if len(x) == 2:
            return _spline(x, y, k=1)
        ends = (slice(4), slice(-4, None)) if len(x) > 3 else ()
        thirds = [_spline(x[end], y[end], k=3)(x[end][0], 3) for end in ends] or [0.0, 0.0]
        return _spline(x, y, k=3, bc_type=tuple([(3, third)] for third in thirds))


@dataclass(frozen=True)
class Wave:
    """A sine: amplitude * sin(omega * q + phase) + offset."""

    amplitude: float = 1.0
    omega: float = 1.0
    phase: float = 0.0
    offset: float = 0.0

    def __post_init__(self) -> None:
        _checked("a sine", [self.amplitude, self.omega, self.phase, self.offset])

    def __call__(self, values: Floats) -> Floats:
        """Return the sine at each value."""
        return self.amplitude * np.sin(self.omega * values + self.phase) + self.offset

    def rescaled(self, x: float, y: float) -> "Wave":
        """Return the function y f(q / x) of q."""
        return Wave(y * self.amplitude, self.omega / x, self.phase, y * self.offset)


def _checked(what: str, numbers: ArrayLike) -> Floats:
    values = np.array(numbers, dtype=np.float64)
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
        raise InputError("", f"{what} must be one finite number or more")
    values.setflags(write=False)
    return values


CoordinateFunction = Polynomial | Knots | Wave
#: The coordinate itself.
IDENTITY = Polynomial(np.array([1.0, 0.0]))
#: Names in OpenSim's files that are understood.
OSIM = toml_table("vtkmuscle.joints", "osim.toml")
_PARTS: dict[str, list[str]] = OSIM["functions"]


def function_of(element: Element, *, missing: CoordinateFunction | None = None) -> CoordinateFunction:
    """Return the function in the child ``function``, or in the element itself."""
    holder = element.find("function")
    if holder is None:
        holder = replace(element, children=[child for child in element.children if child.tag in _PARTS])
    return missing if missing is not None and not holder.children else function_in(holder)


def function_in(holder: Element) -> CoordinateFunction:
    """Return the only function in an element of OpenSim; otherwise raise an InputError."""
    children = [child for child in holder.children if child.tag != "default"]
    if len(children) != 1:
        raise holder.error(f"must hold one function, but holds {len(children)} elements")
    (element,) = children
    if element.tag not in _PARTS:
        raise element.error("unsupported function", f"understood: {', '.join(_PARTS)}")
    try:
        return _function(element)
    except ValueError as error:
        raise element.placed(error) from error


def _function(element: Element) -> CoordinateFunction:
    parts = _PARTS[element.tag]
    if element.tag == "MultiplierFunction":
        element.only((*parts, *_PARTS))
        return function_of(element).rescaled(1.0, element.number("scale", 1.0))
    element.only(parts)
    if element.tag == "Constant":
        return Polynomial(np.array([element.number("value", 0.0)]))
    if element.tag == "Sine":
        return Wave(*map(element.number, parts, (1.0, 1.0, 0.0, 0.0)))
    if parts == ["coefficients"]:
        count = 2 if element.tag == "LinearFunction" else None
        return Polynomial(element.need("coefficients").numbers(count))
    kind = PiecewiseLinear if element.tag == "PiecewiseLinearFunction" else CubicSpline
    return kind(element.need("x").numbers(), element.need("y").numbers())


def function_element(function: CoordinateFunction, **attributes: str) -> ElementTree.Element:
    """Return a function as an element of OpenSim."""
    match function:
        case Polynomial(coefficients) if len(coefficients) == 1:
            return made("Constant", made("value", coefficients), **attributes)
        case Polynomial(coefficients):
            kind = "LinearFunction" if len(coefficients) == 2 else "PolynomialFunction"
            return made(kind, made("coefficients", coefficients), **attributes)
        case Wave():
            parts = (made(name, getattr(function, name)) for name in _PARTS["Sine"])
            return made("Sine", *parts, **attributes)
        case Knots(x, y):
            kind = "SimmSpline" if isinstance(function, CubicSpline) else "PiecewiseLinearFunction"
            return made(kind, made("x", x), made("y", y), **attributes)


def _spline(*knots: Any, **options: Any) -> Any:
    from scipy.interpolate import make_interp_spline  # noqa: PLC0415 -- scenes without joints need none

    return make_interp_spline(*knots, **options)
