"""How the kernels are compiled: the decorators, so that every kernel has options of one of four kinds.

Kernels release the GIL, so that Python threads run them side by side: no numba threading layer is used
anywhere (its ``workqueue`` layer aborts the process on concurrent parallel calls). Division by zero follows
IEEE 754, as in numpy, rather than raising. The machine code is kept by
:mod:`~vtkmuscle.core.kernel_cache`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

from vtkmuscle.core.kernel_cache import kernel_cache

F = TypeVar("F", bound=Callable[..., object])


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
    options: dict[str, Any] = {
        "error_model": "numpy",
        "fastmath": {"contract"},
        "forceinline": True,
        "_nrt": False,
    }
    compiled: F = numba.njit(**options)(function)
    return compiled


def _compiled(function: F, **options: Any) -> F:
    compiled: Any = numba.njit(nogil=True, error_model="numpy", **{"_nrt": False, **options})(function)
    kept = kernel_cache(function)
    if kept is not None and not numba.config.DISABLE_JIT:
        compiled._cache = kept  # as Dispatcher.enable_caching does
    result: F = compiled
    return result
