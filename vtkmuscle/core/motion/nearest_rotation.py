"""The rotation nearest to a matrix: by Newton's method, and by its quaternion where that is no way."""

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

#: Squarings of a matrix: directions whose eigenvalues differ by 1e-10 of the greatest are told apart.
_SQUARINGS = 40


@kernel
def nearest_rotation(matrix: Floats, work: Floats) -> None:
    """Replace a matrix (3, 3) by the rotation R for which tr(R^T M) is greatest.

    The identity where M is 0. work : (8, 4) working memory.
    """
    if not _by_newton(matrix):
        _by_quaternion(matrix, work)


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
def _by_quaternion(matrix: Floats, work: Floats) -> None:
    """Turn any matrix to the rotation nearest to it, one of these if there are several.

    Its unit quaternion q maximises q' K q, with the symmetric K that depends on the matrix linearly (Horn
    1987, doi:10.1364/JOSAA.4.000629). The powers of K + k, positive, tend to the projection on such q.
    """
    power, squared = work[:4], work[4:]
    a, b, c = matrix[0], matrix[1], matrix[2]
    greatest = 0.0
    for i in range(3):
        for j in range(3):
            greatest = max(greatest, abs(matrix[i, j]))
    k = 4.0 * greatest if greatest > 0.0 else 1.0
    power[0, 0], power[1, 1] = k + a[0] + b[1] + c[2], k + a[0] - b[1] - c[2]
    power[2, 2], power[3, 3] = k - a[0] + b[1] - c[2], k - a[0] - b[1] + c[2]
    power[0, 1], power[0, 2], power[0, 3] = c[1] - b[2], a[2] - c[0], b[0] - a[1]
    power[1, 2], power[1, 3], power[2, 3] = b[0] + a[1], a[2] + c[0], c[1] + b[2]
    for i in range(4):
        for j in range(i):
            power[i, j] = power[j, i]
    for _ in range(_SQUARINGS):
        trace = power[0, 0] + power[1, 1] + power[2, 2] + power[3, 3]
        for i in range(4):
            for j in range(4):
                total = 0.0
                for m in range(4):
                    total += (power[i, m] / trace) * (power[m, j] / trace)
                squared[i, j] = total
        power, squared = squared, power
    q = 0
    for i in range(1, 4):
        q = i if power[i, i] > power[q, q] else q
    w, x, y, z = power[q, 0], power[q, 1], power[q, 2], power[q, 3]
    s = 2.0 / (w * w + x * x + y * y + z * z)
    a[0], a[1], a[2] = 1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)
    b[0], b[1], b[2] = s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x)
    c[0], c[1], c[2] = s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y)
