"""Functions of coordinates in OpenSim's files."""

from __future__ import annotations

from vtkmuscle.io.xml_elements import Element
from vtkmuscle.opensim.functions import (
    Constant,
    CoordinateFunction,
    CubicSpline,
    Multiplier,
    PiecewiseLinear,
    Polynomial,
    Wave,
)

#: Tags of the functions that are understood.
FUNCTIONS = (
    "Constant",
    "LinearFunction",
    "PolynomialFunction",
    "SimmSpline",
    "NaturalCubicSpline",
    "natCubicSpline",
    "PiecewiseLinearFunction",
    "MultiplierFunction",
    "Sine",
)


def function_in(holder: Element) -> CoordinateFunction:
    """Return the function that an element holds.

    Raises
    ------
    InputError
        If it holds none, several, or one that is not understood.
    """
    children = [child for child in holder.children if child.tag != "default"]
    if len(children) != 1:
        raise holder.error(f"must hold one function, but holds {len(children)} elements")
    return function_of(children[0])


def function_of(element: Element) -> CoordinateFunction:
    """Return the function that an element is.

    Raises
    ------
    InputError
        If it is not understood.
    """
    tag = element.tag
    if tag not in FUNCTIONS:
        raise element.error("this function is not understood", f"understood: {', '.join(FUNCTIONS)}")
    try:
        return _function(element, tag)
    except ValueError as error:
        raise element.placed(error) from error


def _function(element: Element, tag: str) -> CoordinateFunction:
    if tag == "Constant":
        element.only(("value",))
        return Constant(element.number("value", 0.0))
    if tag in ("LinearFunction", "PolynomialFunction"):
        element.only(("coefficients",))
        count = 2 if tag == "LinearFunction" else None
        return Polynomial(element.need("coefficients").numbers(count))
    if tag == "MultiplierFunction":
        element.only(("function", "scale", *FUNCTIONS))
        inner = element.find("function")
        if inner is None:
            inner = Element("function", element.path, element.line)
            inner.children = [child for child in element.children if child.tag in FUNCTIONS]
        return Multiplier(function_in(inner), element.number("scale", 1.0))
    if tag == "Sine":
        element.only(("amplitude", "omega", "phase", "offset"))
        return Wave(
            element.number("amplitude", 1.0),
            element.number("omega", 1.0),
            element.number("phase", 0.0),
            element.number("offset", 0.0),
        )
    element.only(("x", "y"))
    x, y = element.need("x").numbers(), element.need("y").numbers()
    return PiecewiseLinear(x, y) if tag == "PiecewiseLinearFunction" else CubicSpline(x, y)
