"""A number that tells arrays apart."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

#: Odd numbers with bits set and clear at random, of xxHash64 (https://github.com/Cyan4973/xxHash).
_FIRST, _SECOND, _THIRD = 0x9E3779B185EBCA87, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9
#: Sums of so many words go on side by side.
_LANES = 4


def fingerprint(*arrays: NDArray[Any]) -> tuple[Any, ...]:
    """Return what arrays of equal content share: their shapes, types, and 64 bits of each one's content.

    Two arrays that differ by accident have the same bits once in 2^64 cases. Cryptographic sums take five
    times as long: longer than what is kept for a muscle often takes to find anew.

    Parameters
    ----------
    *arrays : arrays
        Of numbers.

    Returns
    -------
    tuple
        A key for a dictionary.
    """
    key: list[Any] = []
    for array in arrays:
        flat = np.ascontiguousarray(array).reshape(-1)
        whole = flat.nbytes // 8 * 8
        raw = flat.view(np.uint8)
        rest = raw[whole:].tobytes()
        key += [array.shape, array.dtype.str, int(_mixed(raw[:whole].view(np.uint64))), rest]
    return tuple(key)


@kernel
def _mixed(words: NDArray[np.uint64]) -> np.uint64:
    """Return 64 bits of words: those of xxHash64's four lanes, mixed once more."""
    first, second, third = np.uint64(_FIRST), np.uint64(_SECOND), np.uint64(_THIRD)
    left, right = np.uint64(31), np.uint64(33)
    a, b, c, d = first + second, second, np.uint64(0), third
    n = len(words) // _LANES * _LANES
    for i in range(0, n, _LANES):
        a += words[i] * second
        b += words[i + 1] * second
        c += words[i + 2] * second
        d += words[i + 3] * second
        a = ((a << left) | (a >> right)) * first
        b = ((b << left) | (b >> right)) * first
        c = ((c << left) | (c >> right)) * first
        d = ((d << left) | (d >> right)) * first
    for i in range(n, len(words)):
        a = (a ^ words[i]) * second
        a = ((a << left) | (a >> right)) * first
    result = np.uint64(len(words))
    for lane in (a, b, c, d):
        result = (result ^ lane) * first
        result = (result ^ (result >> right)) * second
        result ^= result >> np.uint64(29)
    return result
