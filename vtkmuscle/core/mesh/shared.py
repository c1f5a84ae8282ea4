"""Objects that are made once for all users: from equal arrays, such as surfaces, or for a few keys."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from functools import wraps
from hashlib import sha1
from threading import Lock
from typing import Any, ParamSpec, TypeVar, cast
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray


class RecentlyUsed:
    """A cache of at most so many results by key, which drops the least recently used one."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._results: dict[Hashable, Any] = {}

    def __call__(self, key: Hashable, compute: Callable[[], Any]) -> Any:
        """Return the value kept for a key, or compute and keep it."""
        try:
            result = self._results.pop(key)
        except KeyError:
            result = compute()
        self._results[key] = result
        for oldest in list(self._results)[: -self._most]:
            self._results.pop(oldest, None)
        return result


T = TypeVar("T")
P = ParamSpec("P")


class _Holders:
    """The number of active :func:`held` contexts, and the objects that they keep alive."""

    def __init__(self) -> None:
        self.count = 0
        self.kept: list[object] = []
        self.lock = Lock()


_holders = _Holders()


@contextmanager
def held() -> Iterator[None]:
    """Keep all results of shared functions alive within this context.

    Muscles that are solved one after another then share the objects made from their bones.
    """
    with _holders.lock:
        _holders.count += 1
    try:
        yield
    finally:
        with _holders.lock:
            _holders.count -= 1
            if _holders.count == 0:
                _holders.kept.clear()


def shared(make: Callable[P, T], *, last: int = 0) -> Callable[P, T]:
    """Return a function that gives the same object for equal arrays, as long as anyone holds it.

    The object is made from copies of the arrays, by one thread where several ask at once. The function itself
    holds the ``last`` objects that were asked for.
    """
    known: WeakValueDictionary[bytes, T] = WeakValueDictionary()
    making: dict[bytes, Lock] = {}
    latest: deque[T] = deque(maxlen=last)

    @wraps(make)
    def known_or_made(*arrays: NDArray[Any]) -> T:
        key = digest(*arrays)
        with making.setdefault(key, Lock()):
            result = known.get(key)
            if result is None:
                copies: Any = [array.copy() for array in arrays]  # the caller's may change
                result = known[key] = make(*copies)  # type: ignore[call-arg]
                with _holders.lock:
                    if _holders.count:
                        _holders.kept.append(result)
            with _holders.lock:
                if result in latest:
                    latest.remove(result)
                latest.append(result)
        making.pop(key, None)
        return result

    return cast(Callable[P, T], known_or_made)


def digest(*arrays: NDArray[Any]) -> bytes:
    """Return a key of the content of arrays: by SHA-1, for which processors have instructions."""
    content = sha1(usedforsecurity=False)
    for array in arrays:
        content.update(f"{array.dtype.str}{array.shape}".encode())
        content.update(np.ascontiguousarray(array).data)
    return content.digest()
