"""Anderson acceleration of a fixed-point iteration."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.jit import array_kernel, reduction
from vtkmuscle.core.types import Bools, Floats

#: An accelerated step is taken back where its residual exceeds that of the step before so many times.
GROWTH = 2.0

#: Weight of the identity in the scaled normal equations: below it directions count as the same.
REGULARISATION = 1e-12

#: Numbers that are worked on at once: a few rows of them fit the first-level cache.
_BLOCK = 512


@dataclass(frozen=True, eq=False)
class AndersonResult:
    """Where an accelerated iteration came to.

    Attributes
    ----------
    x : (n,) array
        The last iterate that g was applied to, after that step: g(x_k).
    iterations : int
        Evaluations of g.
    residual : float
        Root mean square over the points of |g(x_k) - x_k| at the last iterate [mm].
    converged : bool
        True where the residual fell to the tolerance.
    residuals : (iterations,) array
        The residual of each evaluation [mm].
    restarts : int
        Accelerated steps taken back because their residual grew.
    """

    x: Floats
    iterations: int
    residual: float
    converged: bool
    residuals: Floats
    restarts: int


def anderson(
    fixed_point_map: Callable[[Floats], Floats],
    start: Floats,
    *,
    max_iterations: int,
    tolerance: float = 0.0,
    points: float | None = None,
    unsteady: Bools | None = None,
    workspace: Workspace | None = None,
) -> AndersonResult:
    """Find x = g(x), faster than by x <- g(x).

    The next iterate is the combination of the last images g(x_j) whose residuals g(x_j) - x_j, combined
    likewise, come nearest to zero: Anderson 1965, doi:10.1145/321296.321305; Walker, Ni 2011, *Anderson
    acceleration for fixed-point iterations*, doi:10.1137/10078356X. The method is safeguarded: where
    the residual of an accelerated step is more than :data:`GROWTH` times that of the step before, the plain
    step is taken instead, and the history is dropped.

    Parameters
    ----------
    fixed_point_map : callable
        g; takes and returns an (n,) array. It must not change its argument; it may return the same memory
        every time.
    start : (n,) array
        First iterate [mm].
    max_iterations : int
        Most evaluations of g, >= 1.
    tolerance : float
        Stop where the residual is at most this [mm]; 0 stops at a fixed point only.
    points : float, optional
        Number of points to take means over; all n / 3 by default. Fewer, where the rest cannot move.
    unsteady : (n,) bool array, optional
        Components by whose residuals the combination is not chosen, as g is not smooth there: points on a
        bone. g may set more of them as it goes.
    workspace : Workspace, optional
        Memory to work in, which says how many past steps are combined; a new one by default.

    Returns
    -------
    AndersonResult
        The point reached, and the history.

    Raises
    ------
    FloatingPointError
        If g gives anything not finite for the start or for a plain step.

    Examples
    --------
    >>> import numpy as np
    >>> result = anderson(np.cos, np.zeros(3), max_iterations=20)
    >>> bool(np.allclose(np.cos(result.x), result.x))
    True
    """
    n = len(start)
    points = n / 3 if points is None else points
    memory = Workspace(n) if workspace is None else workspace
    memory.clear()
    unsteady = np.zeros(n, dtype=np.bool_) if unsteady is None else unsteady
    x, image = memory.x, np.empty(n)
    x[:] = start
    plain = True
    restarts = 0
    residuals: list[float] = []
    last = math.inf
    converged = False
    while len(residuals) < max_iterations and not converged:
        value = fixed_point_map(x)
        residual = root_mean_square_distance(value, x, points)
        worse = not residual <= GROWTH * last
        if not math.isfinite(residual) and plain:
            raise FloatingPointError("the iteration left the range of floating point numbers")
        if worse and not plain:
            # Take the accelerated step back: `image` still is g of the iterate before.
            residuals.append(residual)
            x[:] = image
            memory.clear()
            plain = True
            restarts += 1
            continue
        image[:] = value
        residuals.append(residual)
        last = residual
        converged = residual <= tolerance
        weights = memory.add(x, image, unsteady)
        plain = True
        if weights is not None and not converged:
            memory.combine(image, weights, x)
            plain = False
        else:
            x[:] = image
    return AndersonResult(
        x=image,
        iterations=len(residuals),
        residual=last,
        converged=converged,
        residuals=np.array(residuals),
        restarts=restarts,
    )


class Workspace:
    """Memory of :func:`anderson`: the last differences of residuals and images, products of the former.

    One may serve many calls, one after the other: memory that is new to the process takes as long to come by
    as a call of ten iterations takes to compute.

    Parameters
    ----------
    n : int
        Components of the iterates.
    window : int
        Differences of past steps that are combined, >= 0.
    """

    def __init__(self, n: int, window: int = 10) -> None:
        # Not in single precision, though that would halve the traffic: it rounds a muscle and the same one
        # turned, or in another unit of length, differently, and a solve makes more of what differs.
        self._residuals = np.empty((window, n))
        self._images = np.empty((window, n))
        self._products = np.zeros((window, window))
        self._residual = np.empty(n)
        self._image = np.empty(n)
        self._window = window
        self._count = -1
        #: The iterate.
        self.x: Floats = np.empty(n)

    def clear(self) -> None:
        """Forget all steps."""
        self._count = -1

    def add(self, x: Floats, image: Floats, unsteady: Bools) -> Floats | None:
        """Add a step; return the weights of the differences that reduce its steady residuals most."""
        if self._window == 0:
            return None
        self._count += 1
        row = (self._count - 1) % self._window
        used = min(self._count, self._window)
        dots = np.zeros((2, self._window))
        differences, now = (self._residuals, self._images), (self._residual, self._image)
        _add_step(x, image, unsteady, *now, *differences, row, used, dots)
        if used == 0:
            return None
        self._products[row, :used] = self._products[:used, row] = dots[0, :used]
        weights = _least_squares(self._products[:used, :used].copy(), dots[1, :used])
        return weights if np.isfinite(weights).all() else None

    def combine(self, image: Floats, weights: Floats, x: Floats) -> None:
        """Write the accelerated iterate into x."""
        _combine(image, self._images, weights, x)


@reduction
def _add_step(
    x: Floats,
    image: Floats,
    unsteady: Bools,
    residual: Floats,
    last_image: Floats,
    residuals: Floats,
    images: Floats,
    row: int,
    used: int,
    dots: Floats,
) -> None:
    """Store the differences to the step before and multiply them with all others, in one pass."""
    n = len(x)
    for first in range(0, n, _BLOCK):
        last = min(first + _BLOCK, n)
        now = residual[first:last]
        if used == 0:
            for i in range(last - first):
                now[i] = 0.0 if unsteady[first + i] else image[first + i] - x[first + i]
                last_image[first + i] = image[first + i]
            continue
        newest, newest_image = residuals[row, first:last], images[row, first:last]
        for i in range(last - first):
            r = 0.0 if unsteady[first + i] else image[first + i] - x[first + i]
            newest[i] = r - now[i]
            newest_image[i] = image[first + i] - last_image[first + i]
            now[i] = r
            last_image[first + i] = image[first + i]
        for j in range(used):
            other = residuals[j, first:last]
            a, b = 0.0, 0.0
            for i in range(last - first):
                a += other[i] * newest[i]
                b += other[i] * now[i]
            dots[0, j] += a
            dots[1, j] += b


@array_kernel
def _least_squares(products: Floats, dots: Floats) -> Floats:
    """Return the weights w with products w = dots, by elimination; not finite where there are none.

    The matrix is scaled to a diagonal of 1, to which :data:`REGULARISATION` is added.
    """
    n = len(dots)
    scale, a, w = np.empty(n), np.empty((n, n)), np.empty(n)
    for i in range(n):
        scale[i] = 1.0 / np.sqrt(products[i, i]) if products[i, i] != 0.0 else 1.0
    for i in range(n):
        w[i] = dots[i] * scale[i]
        for j in range(n):
            a[i, j] = products[i, j] * scale[i] * scale[j]
        a[i, i] += REGULARISATION
    for k in range(n):  # positive definite: no pivoting
        for i in range(k + 1, n):
            part = a[i, k] / a[k, k]
            w[i] -= part * w[k]
            for j in range(k, n):
                a[i, j] -= part * a[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            w[k] -= a[k, j] * w[j]
        w[k] /= a[k, k]
    for k in range(n):
        w[k] *= scale[k]
    return w


@reduction
def _combine(image: Floats, images: Floats, weights: Floats, x: Floats) -> None:
    """Write the image minus the weighted differences of images into x."""
    n = len(x)
    for first in range(0, n, _BLOCK):
        last = min(first + _BLOCK, n)
        out = x[first:last]
        for i in range(last - first):
            out[i] = image[first + i]
        for j in range(len(weights)):
            w = weights[j]
            row = images[j, first:last]
            for i in range(last - first):
                out[i] -= w * row[i]


def root_mean_square_distance(a: Floats, b: Floats, points: float) -> float:
    """Return the root mean square over so many points of the distance between two vectors (n,)."""
    return math.sqrt(_squared_distance(a, b) / points)


@reduction
def _squared_distance(a: Floats, b: Floats) -> float:
    """Return |a - b|^2."""
    total = 0.0
    for i in range(len(a)):
        total += (a[i] - b[i]) ** 2
    return total
