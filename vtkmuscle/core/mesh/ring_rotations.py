"""The rotation nearest to a matrix: by Newton's method, and by singular values where that is no way."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import Floats

#: Newton's method is for matrices whose determinant is at least this part of a rotation's of their size.
_NEWTON_FROM = 1e-6

#: Its steps converge quadratically: after one whose square is no more than this nothing is left to correct.
_LAST_STEP2 = 1e-17

#: After a shorter one X is so near that scaling it brings no more.
_SCALED_FROM = 0.1

#: Its steps, at most; five are common.
_MOST_STEPS = 20

#: Sweeps of Jacobi rotations, at most; five are common.
_MOST_SWEEPS = 30

#: Columns are orthogonal where their cosine is no more than this.
_ORTHOGONAL = 1e-15

#: A singular value below this part of the greatest is zero.
_NOTHING = 1e-14


@kernel
def nearest_rotation(matrix: Floats, work: Floats) -> None:
    """Replace a matrix (3, 3) by the rotation R for which tr(R^T M) is greatest.

    The identity where M is 0. work : (6, 3) working memory.
    """
    if not _by_newton(matrix):
        _by_singular_values(matrix, work)


@kernel
def _by_newton(matrix: Floats) -> bool:
    """Replace a matrix (3, 3) by its orthogonal factor, unless it mirrors or is near to one that is singular.

    X <- (g X + X^-T / g) / 2, with g from the norms of X and its inverse; Higham 1986, *Computing the polar
    decomposition - with applications*, doi:10.1137/0907079.
    """
    a, b, c = matrix[0, 0], matrix[0, 1], matrix[0, 2]
    d, e, f = matrix[1, 0], matrix[1, 1], matrix[1, 2]
    g, h, i = matrix[2, 0], matrix[2, 1], matrix[2, 2]
    step2 = np.inf
    for _ in range(_MOST_STEPS):
        # The rows of X^-T, times the determinant: cross products of the rows of X.
        p, q, r = e * i - f * h, f * g - d * i, d * h - e * g
        s, t, u = h * c - i * b, i * a - g * c, g * b - h * a
        v, w, x = b * f - c * e, c * d - a * f, a * e - b * d
        determinant = a * p + b * q + c * r
        m, n = 0.5, 0.5 / determinant
        if step2 > _SCALED_FROM:
            size2 = a * a + b * b + c * c + d * d + e * e + f * f + g * g + h * h + i * i
            other2 = p * p + q * q + r * r + s * s + t * t + u * u + v * v + w * w + x * x
            if not determinant > _NEWTON_FROM * (size2 / 3.0) * np.sqrt(size2 / 3.0):
                return False
            scale = np.sqrt(np.sqrt(other2 / size2) / determinant)
            m, n = m * scale, n / scale
        p, q, r = m * a + n * p, m * b + n * q, m * c + n * r
        s, t, u = m * d + n * s, m * e + n * t, m * f + n * u
        v, w, x = m * g + n * v, m * h + n * w, m * i + n * x
        step2 = (p - a) ** 2 + (q - b) ** 2 + (r - c) ** 2 + (s - d) ** 2 + (t - e) ** 2 + (u - f) ** 2
        step2 += (v - g) ** 2 + (w - h) ** 2 + (x - i) ** 2
        a, b, c, d, e, f, g, h, i = p, q, r, s, t, u, v, w, x
        if step2 <= _LAST_STEP2:
            matrix[0, 0], matrix[0, 1], matrix[0, 2] = a, b, c
            matrix[1, 0], matrix[1, 1], matrix[1, 2] = d, e, f
            matrix[2, 0], matrix[2, 1], matrix[2, 2] = g, h, i
            return True
    return False


@kernel
def _by_singular_values(matrix: Floats, work: Floats) -> None:
    """Replace a matrix (3, 3) by R = U V^T of its singular values.

    The last column of U is turned round where it would mirror: of two columns the third is the cross product,
    so that the two of the greatest singular values are enough.
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
