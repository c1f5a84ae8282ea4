"""Declared parameters: validation, change detection, pickling and documentation."""

import math
import numbers
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import quoted
from vtkmuscle.filters.base.docstrings import Declaration

if TYPE_CHECKING:
    from vtkmuscle.filters.base.filter import Filter

T = TypeVar("T")


@dataclass(eq=False)
class Parameter(Declaration, Generic[T]):
    """A checked property of a filter; a change marks the filter modified.

    Parameters
    ----------
    kind : type
        ``int``, ``float``, ``bool``, ``str``, ``tuple`` (a vector of floats) or any class.
    default : object
        Value of a new filter. ``None`` makes the parameter optional.
    minimum, maximum : float, optional
        Bounds of a number, both allowed values.
    above : float, optional
        Exclusive lower bound.
    choices : tuple of str, optional
        The allowed strings.
    length : int, optional
        Number of components of a vector.
    units : str, optional
        Unit of the value, for the documentation.
    only_with : tuple of str, optional
        Name of another parameter, and the values with which this parameter has an effect. ParaView hides the
        parameter with other values.
    sets : mapping, optional
        For each choice the values of other parameters. Setting the choice sets the values; keywords of a
        constructor take precedence. A value set later stays until the choice is set again.
    listed : str, optional
        Attribute of the filter with the strings to choose from, once its inputs are set.
    doc : str, optional
        Description, if the class's docstring has no entry.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreTubes
    >>> tubes = FibreTubes(radius=0.5)
    >>> tubes.radius = -1.0
    Traceback (most recent call last):
        ...
    vtkmuscle.core.errors.InputError: FibreTubes: radius is -1.0, but must be a finite number > 0
    """

    _: KW_ONLY
    default: T
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None
    choices: tuple[str, ...] = ()
    length: int | None = None
    units: str = ""
    only_with: tuple[str, ...] = ()
    sets: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    listed: str | None = None

    @overload
    def __get__(self, instance: None, owner: type) -> "Parameter[T]": ...

    @overload
    def __get__(self, instance: "Filter", owner: type) -> T: ...

    def __get__(self, instance: "Filter | None", owner: type) -> "T | Parameter[T]":
        if instance is None:
            return self
        value: T = instance._parameter_values[self.name]
        return value

    def __set__(self, instance: "Filter", value: T) -> None:
        checked = self.check(value, type(instance).__name__)
        values = instance._parameter_values
        old = values[self.name]
        plain = type(old) is type(checked) and isinstance(old, (bool, int, float, str, tuple))
        if not (old is checked or (plain and old == checked)):
            values[self.name] = checked
            instance.Modified()
        for other, preset in self.group(checked).items():
            setattr(instance, other, preset)

    def group(self, value: Any) -> Mapping[str, Any]:
        """Return the values of other parameters for a choice."""
        return self.sets.get(value, {}) if self.sets else {}

    def counts_with(self, values: Mapping[str, Any]) -> bool:
        """Return whether the parameter has an effect with these values."""
        return not self.only_with or values[self.only_with[0]] in self.only_with[1:]

    @property
    def condition(self) -> str:
        """Sentence on the condition of an effect; "" without a condition."""
        if not self.only_with:
            return ""
        other, *values = self.only_with
        return f" Counts only with {other} {' or '.join(map(repr, values))}."

    def check_references(self, declarations: Mapping[str, "Parameter[Any]"], owner: str) -> None:
        """Check the parameters and values in `only_with` and `sets`."""
        named = [(self.only_with[0], value) for value in self.only_with[1:]]
        named += [item for group in self.sets.values() for item in group.items()]
        for other, value in named:
            if other not in declarations:
                raise TypeError(f"{owner}.{self.name} refers to {other!r}, which is not declared")
            declarations[other].check(value, owner)

    @property
    def allowed(self) -> str:
        """The allowed values in words."""
        if self.choices:
            words = "one of " + ", ".join(map(repr, self.choices))
        elif self.kind is tuple:
            words = f"{self.length} finite numbers"
        elif self.kind in _WORDS:
            limits = ((">", self.above), (">=", self.minimum), ("<=", self.maximum))
            bounds = " and ".join(f"{sign} {bound:g}" for sign, bound in limits if bound is not None)
            words = f"{_WORDS[self.kind]} {bounds}".strip()
        else:
            article = "an" if self.kind.__name__[0] in "AEIOU" else "a"
            words = f"{article} {self.kind.__name__}"
        return words + (" or None" if self.default is None else "")

    def check(self, value: Any, owner: str) -> Any:
        """Return the value in its type; ValueError lists the allowed values."""
        try:
            return self._converted(value)
        except (TypeError, ValueError, OverflowError):
            raise InputError(owner, f"{self.name} is {quoted(value)}, but must be {self.allowed}") from None

    def _converted(self, value: Any) -> Any:
        if value is None and self.default is None:
            return None
        if self.kind is tuple:
            converted: Any = tuple(_plain(component, float) for component in value)
            allowed = len(converted) == self.length
        else:
            converted = _plain(value, self.kind)
            allowed = (
                (not self.choices or converted in self.choices)
                and (self.minimum is None or converted >= self.minimum)
                and (self.maximum is None or converted <= self.maximum)
                and (self.above is None or converted > self.above)
            )
        if not allowed:
            raise ValueError
        return converted


def quality_of(presets: Mapping[str, Mapping[str, Any]]) -> Parameter[str | None]:
    """Return the parameter ``quality`` of a filter with presets."""
    return Parameter(str, default=None, choices=tuple(presets), sets=presets)


#: Kinds of plain values in words, and the accepted types.
_WORDS = {bool: "True or False", int: "an integer", float: "a finite number", str: "a string"}
_TYPES: dict[type, Any] = {bool: (bool, np.bool_), int: numbers.Integral, float: numbers.Real, str: str}


def _plain(value: Any, kind: type[Any]) -> Any:
    """Return a value converted to its kind; TypeError or ValueError otherwise."""
    is_number = kind in (int, float)
    if not isinstance(value, _TYPES.get(kind, kind)) or (is_number and isinstance(value, bool)):
        raise TypeError
    if kind not in _TYPES:
        return value
    converted = kind(value)
    if is_number and not math.isfinite(converted):
        raise ValueError
    return converted
