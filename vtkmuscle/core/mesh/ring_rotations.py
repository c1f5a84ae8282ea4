"""The rotation nearest to a matrix, by its singular values."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import Floats

#: Sweeps of Jacobi rotations, at most; five are common.
_MOST_SWEEPS = 30

#: Columns are orthogonal where their cosine is no more than this.
_ORTHOGONAL = 1e-15

#: A singular value below this part of the greatest is zero.
_NOTHING = 1e-14


@kernel
def nearest_rotation(matrix: Floats, work: Floats) -> None:
    """Replace a matrix (3, 3) by the rotation R for which tr(R^T M) is greatest.

    R = U V^T by the singular values of M, with the last column of U turned round where it would mirror: of
    two columns the third is the cross product, so that the two of the greatest singular values are enough.
    The identity where M is 0. work : (6, 3) working memory.
    """
    u, v = work[:3], work[3:]  # columns of M V and of V: each a row
    greatest = 0.0
    for a in range(3):
        for b in range(3):
            greatest = max(greatest, abs(matrix[a, b]))
    scale = 1.0 / greatest if greatest > 0.0 else 1.0
    for a in range(3):
        for b in range(3):
            u[b, a] = scale * matrix[a, b]
            v[b, a] = 1.0 if a == b else 0.0
    _orthogonalise(u, v)
    least, most = 0, 0
    for a in range(1, 3):
        least = a if _length(u[a]) < _length(u[least]) else least
        most = a if _length(u[a]) > _length(u[most]) else most
    longest = _length(u[most])
    if least == most:  # all equal
        least, most = 0, 2
    if not longest > 0.0:
        longest = 1.0
        for a in range(3):
            for b in range(3):
                u[a, b] = v[a, b]
    middle = 3 - least - most
    _shorten(u[most], longest)
    length = _length(u[middle])
    if length <= _NOTHING * longest:  # any direction across will do
        _put_across(u[most], u[middle])
        length = _length(u[middle])
    _shorten(u[middle], length)
    _cross(u[most], u[middle], u[least])
    _cross(v[most], v[middle], v[least])
    for a in range(3):
        for b in range(3):
            matrix[a, b] = u[0, a] * v[0, b] + u[1, a] * v[1, b] + u[2, a] * v[2, b]


@kernel
def _length(a: Floats) -> float:
    length: float = np.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    return length


@kernel
def _shorten(a: Floats, times: float) -> None:
    a[0], a[1], a[2] = a[0] / times, a[1] / times, a[2] / times


@kernel
def _put_across(a: Floats, out: Floats) -> None:
    """Write a vector at right angles to a unit vector, by the axis that is the farthest from it."""
    axis = 0
    for k in range(1, 3):
        axis = k if abs(a[k]) < abs(a[axis]) else axis
    along = a[axis]
    for k in range(3):
        out[k] = (1.0 if k == axis else 0.0) - along * a[k]


@kernel
def _orthogonalise(u: Floats, v: Floats) -> None:
    """Rotate pairs of the rows of u (3, 3), and of v with them, until those of u are orthogonal.

    Hestenes 1958, *Inversion of matrices by biorthogonalization and related results*, doi:10.1137/0106005.
    """
    for _ in range(_MOST_SWEEPS):
        done = True
        for pair in range(3):
            first, second = pair // 2, (pair + 3) // 2  # 0 and 1, 0 and 2, 1 and 2
            one, two, both = 0.0, 0.0, 0.0
            for k in range(3):
                one += u[first, k] * u[first, k]
                two += u[second, k] * u[second, k]
                both += u[first, k] * u[second, k]
            if not abs(both) > _ORTHOGONAL * np.sqrt(one * two):
                continue
            done = False
            ratio = (two - one) / (2.0 * both)
            tangent = 1.0 / (abs(ratio) + np.sqrt(1.0 + ratio * ratio))
            tangent = tangent if ratio >= 0.0 else -tangent
            cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
            sine = cosine * tangent
            for k in range(3):
                x, y = u[first, k], u[second, k]
                u[first, k], u[second, k] = cosine * x - sine * y, sine * x + cosine * y
                x, y = v[first, k], v[second, k]
                v[first, k], v[second, k] = cosine * x - sine * y, sine * x + cosine * y
        if done:
            break


@kernel
def _cross(a: Floats, b: Floats, out: Floats) -> None:
    out[0], out[1], out[2] = (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )
