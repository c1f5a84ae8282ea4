"""What is made once for all who ask: of a surface that several muscles share, or for the last few keys."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from functools import wraps
from hashlib import blake2b
from threading import Lock
from typing import Any, ParamSpec, TypeVar, cast
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray


class RecentlyUsed:
    """A cache of a few results by key, which drops the least recently used one.

    Parameters
    ----------
    most : int
        How many things are kept, >= 1.

    Examples
    --------
    >>> from vtkmuscle.core.mesh.shared import RecentlyUsed
    >>> recent = RecentlyUsed(2)
    >>> recent("a", lambda: 1), recent("a", lambda: 2)
    (1, 1)
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._found: dict[Hashable, Any] = {}

    def __call__(self, key: Hashable, find: Callable[[], Any]) -> Any:
        """Return the value kept for a key, or compute and keep it."""
        try:
            found = self._found.pop(key)
        except KeyError:
            found = find()
        self._found[key] = found
        for oldest in list(self._found)[: -self._most]:
            self._found.pop(oldest, None)
        return found


T = TypeVar("T")
P = ParamSpec("P")


class _Holders:
    """The holders of shared objects, and the objects of each."""

    def __init__(self) -> None:
        self.count = 0
        self.kept: list[object] = []
        self.lock = Lock()


_holders = _Holders()


@contextmanager
def held() -> Iterator[None]:
    """Keep all results of shared functions within this context alive.

    Muscles that are solved one after another then share what is made from their bones.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.triangle_tree import shared_tree
    >>> points, triangles = np.eye(3), np.array([[0, 1, 2]])
    >>> with held():
    ...     first = id(shared_tree(points, triangles))
    ...     id(shared_tree(points, triangles)) == first
    True
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

    Parameters
    ----------
    make : callable
        What makes an object from arrays, as points (n, 3) and triangles (m, 3), which are copied for it.
    last : int, optional
        How many objects that were asked for last are held here.

    Returns
    -------
    callable
        Of several threads that ask for the same arrays one makes the object.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.triangle_tree import triangle_tree
    >>> tree_of = shared(triangle_tree)
    >>> points, triangles = np.eye(3), np.array([[0, 1, 2]])
    >>> tree = tree_of(points, triangles)
    >>> tree_of(points.copy(), triangles) is tree
    True
    """
    known: WeakValueDictionary[bytes, T] = WeakValueDictionary()
    making: dict[bytes, Lock] = {}
    latest: deque[T] = deque(maxlen=last)

    @wraps(make)
    def found_or_made(*arrays: NDArray[Any]) -> T:
        key = _digest(arrays)
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

    return cast(Callable[P, T], found_or_made)


def _digest(arrays: tuple[NDArray[Any], ...]) -> bytes:
    content = blake2b(digest_size=16)
    for array in arrays:
        content.update(f"{array.dtype.str}{array.shape}".encode())
        content.update(np.ascontiguousarray(array).data)
    return content.digest()
