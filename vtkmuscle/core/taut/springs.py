"""Kernels of a chain of springs: what is added to its equations, and their solution."""

from __future__ import annotations

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import Floats

#: Stiffness of a bone or ring against a string's point, in stiffnesses of the string's springs. A point on a
#: bone of radius R with points h apart sinks in by h^2 / (R PUSH): 1e-4 mm where h is 4 mm and R 10 mm.
PUSH = 1e4


@kernel
def add_spring(n: Floats, stiffness: float, at: float, matrix: Floats, right: Floats) -> None:
    """Add the spring s (n . x - at)^2 / 2 to a point's matrix (xx, xy, xz, yy, yz, zz) and right side."""
    matrix[0] += stiffness * n[0] * n[0]
    matrix[1] += stiffness * n[0] * n[1]
    matrix[2] += stiffness * n[0] * n[2]
    matrix[3] += stiffness * n[1] * n[1]
    matrix[4] += stiffness * n[1] * n[2]
    matrix[5] += stiffness * n[2] * n[2]
    for q in range(3):
        right[q] += stiffness * at * n[q]


@kernel
def solve(p: Floats, matrices: Floats, right: Floats, y: Floats) -> None:
    """Solve A_i y_i - y_{i-1} - y_{i+1} = r_i with the ends of p, by elimination; y may be of any size."""
    n = len(p)
    for q in range(3):
        right[1, q] += p[0, q]
        right[n - 2, q] += p[n - 1, q]
    for i in range(1, n - 1):
        h = matrices[i]
        if i > 1:
            w, z = matrices[i - 1], right[i - 1]
            for q in range(6):
                h[q] -= w[q]
            right[i, 0] += w[0] * z[0] + w[1] * z[1] + w[2] * z[2]
            right[i, 1] += w[1] * z[0] + w[3] * z[1] + w[4] * z[2]
            right[i, 2] += w[2] * z[0] + w[4] * z[1] + w[5] * z[2]
        a, b, c, d, e, g = h[0], h[1], h[2], h[3], h[4], h[5]
        size = 1.0 / (a * (d * g - e * e) + b * (c * e - b * g) + c * (b * e - c * d))
        h[0], h[1], h[2] = size * (d * g - e * e), size * (c * e - b * g), size * (b * e - c * d)
        h[3], h[4], h[5] = size * (a * g - c * c), size * (b * c - a * e), size * (a * d - b * b)
    for i in range(n - 2, 0, -1):
        h, z = matrices[i], right[i]
        if i < n - 2:
            for q in range(3):
                z[q] += y[i + 1, q]
        y[i, 0] = h[0] * z[0] + h[1] * z[1] + h[2] * z[2]
        y[i, 1] = h[1] * z[0] + h[3] * z[1] + h[4] * z[2]
        y[i, 2] = h[2] * z[0] + h[4] * z[1] + h[5] * z[2]
