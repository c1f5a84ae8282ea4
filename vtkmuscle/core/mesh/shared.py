"""Results shared by their users, per content of arrays."""

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from hashlib import sha1
from threading import RLock
from typing import Any, ParamSpec, TypeVar, cast
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")
P = ParamSpec("P")
#: Results of shared functions per active :func:`keep_shared` context.
_kept: dict[int, list[object]] = {}


@contextmanager
def keep_shared() -> Iterator[None]:
    """Keep all results of shared functions within a context. Muscles in turn then share bones."""
    kept: list[object] = []
    _kept[id(kept)] = kept
    try:
        yield
    finally:
        del _kept[id(kept)]


def shared(make: Callable[P, T], *, last: int = 0) -> Callable[P, T]:
    """Return a function with shared results for equal arrays. A result lives while in use.

    The object is made from copies of the arrays and texts, in a single thread. The function itself keeps its
    ``last`` results.
    """
    results: WeakValueDictionary[bytes, T] = WeakValueDictionary()
    latest: deque[T] = deque(maxlen=last)
    lock = RLock()  # of this function: the building of other objects need not wait

    @wraps(make)
    def shared_result(*arrays: NDArray[Any] | str) -> T:
        key = digest(*map(np.asarray, arrays))
        with lock:
            result = results.get(key)
            if result is None:
                copies: Any = [np.array(array, order="C") for array in arrays]  # the caller's may change
                result = results[key] = make(*copies)  # type: ignore[call-arg]
                for kept in list(_kept.values()):
                    kept.append(result)
            if result in latest:
                latest.remove(result)
            latest.append(result)
        return result

    return cast(Callable[P, T], shared_result)


def same_content(first: Any, second: Any) -> bool:
    """Return whether values are equal; arrays count by content, tuples by their items."""
    if first is second:
        return True
    arrays = [isinstance(each, np.ndarray) for each in (first, second)]
    if any(arrays):
        return all(arrays) and np.array_equal(first, second)
    if isinstance(first, tuple) and isinstance(second, tuple):
        return len(first) == len(second) and all(map(same_content, first, second))
    return bool(first == second)


def digest(*arrays: NDArray[Any]) -> bytes:
    """Return a key of arrays' content, by SHA-1. Processors have instructions for SHA-1."""
    content = sha1(usedforsecurity=False)
    for array in arrays:
        content.update(f"{array.dtype.str}{array.shape}".encode())
        content.update(np.ascontiguousarray(array).data)
    return content.digest()
