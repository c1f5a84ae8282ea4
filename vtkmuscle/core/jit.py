"""How the kernels are compiled: numba's ``njit``, with one of four sets of options.

Kernels release the GIL, so that Python threads run them side by side: no numba threading layer is used
anywhere (its ``workqueue`` layer aborts the process on concurrent parallel calls). Division by zero follows
IEEE 754, as in numpy, rather than raising. The machine code is kept by
:mod:`~vtkmuscle.core.kernel_cache`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba
import numba.core.options

from vtkmuscle.core.kernel_cache import keep_kernel

F = TypeVar("F", bound=Callable[..., object])


def uncounted() -> dict[str, bool]:
    """Return the option that leaves out the counting of references, none where numba does not know it."""
    return {"_nrt": False} if hasattr(numba.core.options.DefaultOptions, "_nrt") else {}


#: See :func:`uncounted`.
UNCOUNTED = uncounted()


def kernel(function: F) -> F:
    """Compile a numeric kernel that makes no arrays with numba, and keep the machine code on disk.

    The views that it takes of the arrays it is given, ``points[i]``, are not counted as references, where
    numba can leave that out. Counting is an atomic operation: looking up distances takes three times as long
    with it.

    Parameters
    ----------
    function : callable
        A function of plain arrays and numbers. One that makes an array is an :func:`array_kernel`.

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
    return _compiled(function, **UNCOUNTED)


def array_kernel(function: F) -> F:
    """Compile as :func:`kernel` does a function that makes arrays; its inner loops are kernels."""
    return _compiled(function)


def reduction(function: F) -> F:
    """Compile as :func:`kernel` does; sums may be taken in several parts at a time."""
    return _compiled(function, fastmath={"contract", "reassoc"}, **UNCOUNTED)


def vector_kernel(function: F) -> F:
    """Compile as :func:`kernel` does, with multiplications and additions fused."""
    return _compiled(function, fastmath={"contract"}, **UNCOUNTED)


def lane(function: F) -> F:
    """Compile the work of one SIMD lane; it is inlined into the loop that calls it."""
    return _compiled(function, fastmath={"contract"}, forceinline=True, nogil=False, **UNCOUNTED)


def _compiled(function: F, **options: Any) -> F:
    compiled: Any = numba.njit(**{"nogil": True, "error_model": "numpy", **options})(function)
    keep_kernel(compiled)
    result: F = compiled
    return result
