"""How the kernels are compiled: the decorators, so that every kernel has options of one of five kinds.

Kernels release the GIL, so that Python threads run them side by side: no numba threading layer is used
anywhere (its ``workqueue`` layer aborts the process on concurrent parallel calls). Division by zero follows
IEEE 754, as in numpy, rather than raising. The machine code is kept by
:mod:`~vtkmuscle.core.kernel_cache`.

Compiling takes most of the time of a first run. So what nobody calls, entry points for C, is not compiled,
and Python does not look for garbage meanwhile: that took a sixth of the time, since numba makes objects by
the million, hardly any of which is garbage before a kernel is done.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, TypeVar

import numba
from numba.core import event
from numba.core.types import unliteral  # type: ignore[attr-defined]

from vtkmuscle.core.kernel_cache import kernel_cache
from vtkmuscle.core.kernel_parts import KernelCompiler, part_of_kernels

F = TypeVar("F", bound=Callable[..., object])

_OF_ALL: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "no_cfunc_wrapper": True,
    "_nrt": False,
}


class _WithoutCollection(event.Listener):  # type: ignore[misc]
    """Holds Python's search for garbage while a kernel is compiled: one at a time, under numba's lock."""

    def __init__(self) -> None:
        self._depth = 0
        self._was_on = False

    def on_start(self, _: event.Event) -> None:
        """Stop it, where a kernel begins that is not part of another."""
        if self._depth == 0:
            self._was_on = gc.isenabled()
            gc.disable()
        self._depth += 1

    def on_end(self, _: event.Event) -> None:
        """Let it go on as before."""
        self._depth -= 1
        if self._depth == 0 and self._was_on:
            gc.enable()


event.register("numba:compile", _WithoutCollection())


def kernel(function: F) -> F:
    """Compile a numeric kernel that makes no arrays with numba, and keep the machine code on disk.

    The views that it takes of the arrays it is given, ``points[i]``, are not counted as references. Counting
    is an atomic operation: in a loop over points it takes longer than the arithmetic, and longer still where
    threads share the array.

    Parameters
    ----------
    function : callable
        A function of plain arrays and numbers. Numba refuses to compile one that makes an array; that is
        an :func:`array_kernel`.

    Returns
    -------
    callable
        The compiled function, with the same signature.

    Examples
    --------
    >>> import numpy as np
    >>> @kernel
    ... def total(values):
    ...     result = 0.0
    ...     for value in values:
    ...         result += value
    ...     return result
    >>> total(np.ones(3))
    3.0
    """
    return _compiled(function)


def array_kernel(function: F) -> F:
    """Compile as :func:`kernel` does a function that makes arrays; its inner loops are kernels."""
    return _compiled(function, _nrt=True)


def reduction(function: F) -> F:
    """Compile as :func:`kernel` does; sums may be taken in several parts at a time."""
    return _compiled(function, fastmath={"contract", "reassoc"})


def vector_kernel(function: F) -> F:
    """Compile as :func:`kernel` does, with multiplications and additions fused."""
    return _compiled(function, fastmath={"contract"})


def lane(function: F) -> F:
    """Compile what one lane of a batch computes; it becomes part of the loop that calls it."""
    return _compiled(function, fastmath={"contract"}, forceinline=True, nogil=False)


def _compiled(function: F, **options: Any) -> F:
    options = {**_OF_ALL, **options}
    compiled: Any = numba.njit(pipeline_class=KernelCompiler, **options)(function)
    kept = kernel_cache(function)
    if kept is not None and not numba.config.DISABLE_JIT:
        compiled._cache = kept  # as Dispatcher.enable_caching does

    @cache
    def part() -> Any:
        return part_of_kernels(function, **options)

    def part_for(args: Sequence[Any], keywords: Mapping[str, Any]) -> Any:
        """Compile the part once for ``int``, and not for each constant that kernels call it with."""
        return part().get_call_template(
            tuple(map(unliteral, args)),
            {name: unliteral(value) for name, value in keywords.items()},
        )

    # What numba asks a function for that another one calls.
    compiled.get_call_template = part_for
    compiled.get_overload = lambda types: part().get_overload(types)
    result: F = compiled
    return result
