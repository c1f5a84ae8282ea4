"""Algebra of small full matrices on one thread: the same result whatever else the machine does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import reduction

Floats = NDArray[np.float64]

#: Part of its diagonal that is added to a matrix before it is factorised.
REGULARISATION = 1e-9


@reduction
def inverse_of(matrix: Floats) -> Floats:
    """Return the inverse of a positive definite matrix, by its lower triangle, which is overwritten.

    By dot products of rows, on one thread: a library's own threads would wait for each other where other
    muscles are solved at the same time, and its result could depend on their number.
    """
    size = len(matrix)
    for i in range(size):  # matrix = l l'
        row = matrix[i]
        for j in range(i + 1):
            other = matrix[j]
            total = row[j]
            for k in range(j):
                total -= row[k] * other[k]
            row[j] = np.sqrt(total) if i == j else total / other[j]
    half = np.zeros((size, size))  # the transpose of l's inverse
    for j in range(size):
        column = half[j]
        column[j] = 1.0 / matrix[j, j]
        for i in range(j + 1, size):
            row = matrix[i]
            total = 0.0
            for k in range(j, i):
                total -= row[k] * column[k]
            column[i] = total / row[i]
    inverse = np.empty((size, size))
    for i in range(size):
        row = half[i]
        for j in range(i + 1):
            other = half[j]
            total = 0.0
            for k in range(i, size):
                total += row[k] * other[k]
            inverse[i, j] = inverse[j, i] = total
    return inverse


@reduction
def multiply(matrix: Floats, vector: Floats, result: Floats) -> None:
    """Write the product of a matrix (m, n) and a vector (n,) into the result (m,)."""
    for i in range(len(matrix)):
        row = matrix[i]
        total = 0.0
        for j in range(len(vector)):
            total += row[j] * vector[j]
        result[i] = total


@reduction
def factorised(rows: Floats, answers: Floats, compliances: Floats) -> Floats:
    """Return the Cholesky factor (m, m) of rows answers' and the compliances, slightly regularised."""
    count = len(rows)
    factor = np.zeros((count, count))
    for m in range(count):
        used = np.flatnonzero(rows[m])  # a contact's row knows a few nodes only
        row = rows[m][used]
        for n in range(m + 1):
            total = 0.0
            answer = answers[n]
            for k in range(len(used)):
                total += row[k] * answer[used[k]]
            if m == n:
                total = total * (1.0 + REGULARISATION) + compliances[m]
            for k in range(n):
                total -= factor[m, k] * factor[n, k]
            if m == n:
                factor[m, m] = np.sqrt(total) if total > 0.0 else np.inf  # not resolved: not respected
            else:
                factor[m, n] = total / factor[n, n]
    return factor


@reduction
def respect(rows: Floats, answers: Floats, factor: Floats, motion: Floats) -> None:
    """Take out of a motion (6 c,) what rows (m, 6 c) forbid."""
    count = len(rows)
    multipliers = np.empty(count)
    for m in range(count):
        total = 0.0
        row = rows[m]
        for k in range(len(motion)):
            total += row[k] * motion[k]
        for n in range(m):
            total -= factor[m, n] * multipliers[n]
        multipliers[m] = total / factor[m, m]
    for m in range(count - 1, -1, -1):
        for n in range(m + 1, count):
            multipliers[m] -= factor[n, m] * multipliers[n]
        multipliers[m] /= factor[m, m]
    for m in range(count):
        answer = answers[m]
        for k in range(len(motion)):
            motion[k] -= multipliers[m] * answer[k]
