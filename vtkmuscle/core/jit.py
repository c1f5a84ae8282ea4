"""How the kernels are compiled: one decorator, so that every kernel has the same options."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numba

F = TypeVar("F", bound=Callable[..., object])


def kernel(function: F) -> F:
    """Compile a numeric kernel with numba, and cache the machine code on disk.

    Kernels release the GIL, so that Python threads run them side by side: no numba threading layer
    is used anywhere (its ``workqueue`` layer aborts the process on concurrent parallel calls).
    Division by zero follows IEEE 754, as in numpy, rather than raising.

    Parameters
    ----------
    function : callable
        A function of plain arrays and numbers.

    Returns
    -------
    callable
        The compiled function, with the same signature.
    """
    compiled: F = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return compiled
