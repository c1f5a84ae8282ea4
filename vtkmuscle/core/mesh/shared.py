"""What is made from a surface, made once for all who hold it: the muscles of a scene share their bones."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from hashlib import blake2b
from threading import Lock
from typing import TypeVar
from weakref import WeakValueDictionary

import numpy as np

from vtkmuscle.core.types import Floats, Ints

T = TypeVar("T")


def shared(make: Callable[[Floats, Ints], T]) -> Callable[[Floats, Ints], T]:
    """Return a function that gives the same object for equal surfaces, as long as anyone holds it.

    Parameters
    ----------
    make : callable
        What makes an object from points (n, 3) and triangles (m, 3); the object is not changed afterwards.

    Returns
    -------
    callable
        With the same signature. Of several threads that ask for the same surface one makes the object.

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

    @wraps(make)
    def found_or_made(points: Floats, triangles: Ints) -> T:
        key = _digest(points, triangles)
        with making.setdefault(key, Lock()):
            result = known.get(key)
            if result is None:
                result = known[key] = make(points, triangles)
        making.pop(key, None)
        return result

    return found_or_made


def _digest(points: Floats, triangles: Ints) -> bytes:
    content = blake2b(digest_size=16)
    for array in (points, triangles):
        content.update(f"{array.dtype.str}{array.shape}".encode())
        content.update(np.ascontiguousarray(array).data)
    return content.digest()
