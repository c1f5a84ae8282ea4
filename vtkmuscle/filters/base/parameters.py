"""Declared parameters: one declaration gives validation, change guards, pickling and docs."""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Generic, TypeVar, overload

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import quoted
from vtkmuscle.filters.base.docstrings import entry

if TYPE_CHECKING:
    from vtkmuscle.filters.base.filter import Filter

T = TypeVar("T")


class Parameter(Generic[T]):
    """A property of a filter that is checked when set and marks the filter modified when it changes.

    Parameters
    ----------
    kind : type
        ``int``, ``float``, ``bool``, ``str``, ``tuple`` (a vector of floats) or any class.
    default : object
        Value of a new filter. ``None`` makes the parameter optional.
    minimum, maximum : float, optional
        Bounds of a number, both allowed values.
    above : float, optional
        A bound that the number must exceed.
    choices : sequence of str, optional
        The allowed strings.
    length : int, optional
        Number of components of a vector.
    units : str, optional
        Unit of the value, for the documentation.
    only_with : tuple of str, optional
        Name of another parameter, and the values of it with which this one counts; with others it says
        nothing, and ParaView hides it.
    sets : mapping, optional
        For each of the choices the values of other parameters that it stands for. Setting the choice sets
        them; a constructor's keywords count more. One that is set later is kept until the choice is set
        again.
    doc : str, optional
        What the parameter does, where the class's docstring has no entry of its name.

    Examples
    --------
    >>> from vtkmuscle.filters import FibreTubes
    >>> tubes = FibreTubes(radius=0.5)
    >>> tubes.radius = -1.0
    Traceback (most recent call last):
        ...
    vtkmuscle.core.errors.InputError: FibreTubes: radius is -1.0, but must be a finite number > 0
    """

    def __init__(
        self,
        kind: type[Any],
        *,
        default: T,
        minimum: float | None = None,
        maximum: float | None = None,
        above: float | None = None,
        choices: Sequence[str] = (),
        length: int | None = None,
        units: str = "",
        only_with: tuple[str, *tuple[str, ...]] | None = None,
        sets: Mapping[str, Mapping[str, Any]] | None = None,
        doc: str = "",
    ) -> None:
        self.kind = kind
        self.default = default
        self.minimum = minimum
        self.maximum = maximum
        self.above = above
        self.choices = tuple(choices)
        self.length = length
        self.units = units
        self.only_with = only_with
        self.sets = dict(sets or {})
        self.doc = doc
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name
        self.doc = self.doc or entry(owner.__doc__, name)

    @overload
    def __get__(self, instance: None, owner: type) -> Parameter[T]: ...

    @overload
    def __get__(self, instance: Filter, owner: type) -> T: ...

    def __get__(self, instance: Filter | None, owner: type) -> T | Parameter[T]:
        if instance is None:
            return self
        value: T = instance._parameter_values[self.name]
        return value

    def __set__(self, instance: Filter, value: T) -> None:
        checked = self.check(value, type(instance).__name__)
        values = instance._parameter_values
        if not self._same(values[self.name], checked):
            values[self.name] = checked
            instance.Modified()
        for other, given in self.group(checked).items():
            setattr(instance, other, given)

    def group(self, value: Any) -> Mapping[str, Any]:
        """Return the values of other parameters that a value stands for."""
        return self.sets.get(value, {}) if self.sets else {}

    def counts_with(self, values: Mapping[str, Any]) -> bool:
        """Return whether the parameter says anything beside the values of the others."""
        return self.only_with is None or values[self.only_with[0]] in self.only_with[1:]

    @property
    def condition(self) -> str:
        """With what the parameter counts, as the end of a sentence; empty where it always does."""
        if self.only_with is None:
            return ""
        other, *values = self.only_with
        return f" Counts only with {other} {' or '.join(map(repr, values))}."

    def check_references(self, declarations: Mapping[str, Parameter[Any]], owner: str) -> None:
        """Check that the other parameters that are named exist, and allow the values that are named."""
        named = [] if self.only_with is None else [(self.only_with[0], v) for v in self.only_with[1:]]
        named += [item for group in self.sets.values() for item in group.items()]
        for other, value in named:
            if other not in declarations:
                raise TypeError(f"{owner}.{self.name} refers to {other!r}, which is not declared")
            declarations[other].check(value, owner)

    @staticmethod
    def _same(old: Any, new: Any) -> bool:
        if old is new:
            return True
        plain = (bool, int, float, str, tuple)
        return isinstance(old, plain) and type(old) is type(new) and bool(old == new)

    @property
    def allowed(self) -> str:
        """The allowed values in words."""
        if self.choices:
            words = "one of " + ", ".join(repr(choice) for choice in self.choices)
        elif self.kind is bool:
            words = "True or False"
        elif self.kind is tuple:
            words = f"{self.length} finite numbers"
        elif self.kind in (int, float):
            words = "an integer" if self.kind is int else "a finite number"
            bounds = [
                f"{sign} {bound:g}"
                for sign, bound in ((">", self.above), (">=", self.minimum), ("<=", self.maximum))
                if bound is not None
            ]
            words = " ".join([words, " and ".join(bounds)]).strip()
        elif self.kind is str:
            words = "a string"
        else:
            article = "an" if self.kind.__name__[0] in "AEIOU" else "a"
            words = f"{article} {self.kind.__name__}"
        return words + (" or None" if self.default is None else "")

    def check(self, value: Any, owner: str) -> Any:
        """Return the value in its own type, or raise a ValueError that says what is allowed."""
        converted = self._converted(value)
        if converted is _INVALID:
            raise InputError(owner, f"{self.name} is {quoted(value)}, but must be {self.allowed}")
        return converted

    def _converted(self, value: Any) -> Any:
        if value is None:
            return None if self.default is None else _INVALID
        convert = _CONVERTERS.get(self.kind)
        if convert is None:
            return value if isinstance(value, self.kind) else _INVALID
        converted = convert(value)
        return converted if converted is not _INVALID and self._within(converted) else _INVALID

    def _within(self, value: Any) -> bool:
        if self.choices:
            return value in self.choices
        if self.length is not None:
            return len(value) == self.length
        return (
            (self.minimum is None or value >= self.minimum)
            and (self.maximum is None or value <= self.maximum)
            and (self.above is None or value > self.above)
        )


class _Invalid:
    """Says that a value is not allowed (None may be a value)."""


_INVALID = _Invalid()


def _to_bool(value: Any) -> Any:
    is_bool = isinstance(value, bool) or type(value).__name__ in ("bool", "bool_")
    return bool(value) if is_bool else _INVALID


def _to_int(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, numbers.Integral):
        return _INVALID
    return int(value)


def _to_float(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, numbers.Real):
        return _INVALID
    try:
        return float(value) if math.isfinite(value) else _INVALID
    except OverflowError:  # an integer that no float is as large as
        return _INVALID


def _to_str(value: Any) -> Any:
    return str(value) if isinstance(value, str) else _INVALID


def _to_vector(value: Any) -> Any:
    if isinstance(value, str):
        return _INVALID
    try:
        numbers_ = [_to_float(component) for component in value]
    except TypeError:
        return _INVALID
    return _INVALID if any(n is _INVALID for n in numbers_) else tuple(numbers_)


_CONVERTERS: dict[type[Any], Callable[[Any], Any]] = {
    bool: _to_bool,
    int: _to_int,
    float: _to_float,
    str: _to_str,
    tuple: _to_vector,
}
