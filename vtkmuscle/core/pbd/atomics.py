"""Numbers in memory that several threads count up and watch, inside kernels that hold no lock."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_untracked
from numba.extending import intrinsic as _untyped_intrinsic

#: Hands the processor to another thread: the operating system's own function.
give_way = types.ExternalFunction("SwitchToThread" if os.name == "nt" else "sched_yield", types.int32())


def intrinsic(function: Callable[..., Any]) -> Callable[..., Any]:
    """Make a function of a kernel from what writes its instructions."""
    made: Callable[..., Any] = _untyped_intrinsic(function)
    return made


def _pointer(context: Any, builder: Any, signature: Any, values: Any) -> Any:
    array = context.make_array(signature.args[0])(context, builder, values[0])
    return cgutils.get_item_pointer(
        context, builder, signature.args[0], array, [values[1]], wraparound=False, boundscheck=False
    )


@intrinsic
def fetch_add(typing_context: Any, array: Any, index: Any, value: Any) -> Any:
    """Add to an integer of an array at once for all threads; return what it was before."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = _pointer(context, builder, signature, values)
        return builder.atomic_rmw("add", pointer, values[2], "seq_cst")

    return array.dtype(array, types.intp, array.dtype), generate


@intrinsic
def exchange(typing_context: Any, array: Any, index: Any, old: Any, new: Any) -> Any:
    """Put a new integer where an old one is; return whether it was still there: of all threads, once."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = _pointer(context, builder, signature, values)
        result = builder.cmpxchg(pointer, values[2], values[3], "seq_cst")
        return builder.extract_value(result, 1)

    return types.boolean(array, types.intp, array.dtype, array.dtype), generate


@intrinsic
def load(typing_context: Any, array: Any, index: Any) -> Any:
    """Return an integer of an array; all that was written before it was counted up is visible then."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        pointer = _pointer(context, builder, signature, values)
        number = builder.load_atomic(pointer, "acquire", signature.args[0].dtype.bitwidth // 8)
        return impl_ret_untracked(context, builder, signature.return_type, number)

    return array.dtype(array, types.intp), generate
