"""Types of calls remembered while kernels are compiled.

For each ``a + b`` in a kernel numba tries all that it knows to add, from the beginning: thirty thousand
times for the kernels of a first run, in all but a thousand of which it has found the same before. Compiling
these kernels takes a fifth less time where that is remembered.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import types
from numba.core.targetconfig import ConfigStack

#: The class of functions that numba knows: operators, those of ``math`` and ``numpy``.
_Function: Any = types.Function
_find: Any = _Function.get_call_type

#: What was found: by the function, the types of arguments and the options of the caller. With the function,
#: which is told by its identity and must not be replaced by another at the same place.
_found: dict[Any, tuple[Any, Any]] = {}


class _Options:
    """The options that a function is compiled with, as a number: numba's own comparison takes long."""

    def __init__(self) -> None:
        self._numbers: dict[str, int] = {}
        self._last: tuple[Any, int] = None, -1

    def number(self) -> int:
        """Return the number of those of the function that is being compiled."""
        options = ConfigStack.top_or_none()
        if options is not self._last[0]:  # a copy for each compilation, which nobody changes
            self._last = options, self._numbers.setdefault(repr(options), len(self._numbers))
        return self._last[1]


_options = _Options()


def _remembered(self: Any, context: Any, args: tuple[Any, ...], keywords: dict[str, Any]) -> Any:
    """Return what numba finds for a call, from memory where it is there."""
    try:
        key = id(self), id(context), args, tuple(keywords.items()), _options.number()
        known = _found.get(key)
    except TypeError:  # a constant that has no hash: a slice
        return _find(self, context, args, keywords)
    if known is None:
        # What cannot be called raises an error, and is not remembered.
        known = _found[key] = _find(self, context, args, keywords), (self, context)
    return known[0]


@contextmanager
def call_types_remembered() -> Iterator[None]:
    """Let numba remember the types of calls; it holds its lock for compiling meanwhile."""
    before = _Function.get_call_type
    _Function.get_call_type = _remembered
    try:
        yield
    finally:
        _Function.get_call_type = before
