"""How far an iterate is from where the iteration leads, estimated from the way it has come."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

import numba
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
F = TypeVar("F", bound=Callable[..., object])

#: Iterations between two estimates of the distance.
ESTIMATE_EVERY = 5

#: The estimate compares with the iterate at this part of the iterations done; see :func:`estimate_distance`.
LOOK_BACK = 0.8

#: Factor of the estimate. It, the form and the powers were fitted to 1 267 checkpoints of 37 solves (four
#: muscles of 2 500 to 9 900 points, 1 to 20 degrees, isotropic and anisotropic, no collision), 96 % of
#: which it meets within a factor of 2. On 1 013 checkpoints of other motions of the same muscles, which took
#: no part in the fit, it meets 89 %; with the typical amplification instead of the muscle's own only 67 %.
CALIBRATION = 2.2

#: Amplification of a muscle of 602 points whose own is not known (500 to 11 000 were seen), and how it grows
#: with their number.
TYPICAL_AMPLIFICATION = (602, 2600.0)
AMPLIFICATION_GROWTH = 1.25


def reduction(function: F) -> F:
    """Compile as :func:`~vtkmuscle.core.jit.kernel` does; sums may be taken in several parts at a time."""
    compiled: F = numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc"})(
        function
    )
    return compiled


def estimate_distance(residual: float, earlier_residual: float, moved: float, amplification: float) -> float:
    """Return about how far an accelerated iterate is from the fixed point.

    The distance e is the residual r times an amplification |(1 - J)^-1|, which is large: a Gauss-Seidel
    iteration moves a smooth error by little. The amplification of what has been removed lately is |x - x'| /
    r', with x' an iterate some time ago: too little for what is left, as an accelerated iteration removes
    what is amplified least first. The largest amplification A that the muscle has is too much. Their
    geometric mean, and a factor r / r' for how much has been removed since, gives

        e = c (r / r') sqrt(A r |x - x'|).

    The form and c = :data:`CALIBRATION` were found by regression on solves followed to their end.

    Parameters
    ----------
    residual, earlier_residual : float
        r and r', root mean squares over the points [mm].
    moved : float
        |x - x'|, likewise [mm].
    amplification : float
        A, the greatest ratio of distance to residual [1].

    Returns
    -------
    float
        [mm].
    """
    if residual == 0.0:
        return 0.0
    if not (moved > 0.0 and earlier_residual > 0.0):
        return amplification * residual
    ratio = min(residual / earlier_residual, 1.0)
    return min(CALIBRATION * ratio * math.sqrt(amplification * residual * moved), amplification * residual)


class Trail:
    """The iterates of a solve; a few are kept to compare with, each a tenth further on than the last.

    Parameters
    ----------
    points : float
        Number of points.
    amplification : float
        See :func:`estimate_distance`.
    spare : list of (n,) arrays, optional
        Memory of another trail that is not needed any more; what this one takes in addition is added.
    bound : float, optional
        Where the iteration is a contraction: how many times the residual an iterate can be away from the
        end, which then is said instead of an estimate.

    Attributes
    ----------
    distance : float
        Last estimate [mm].
    estimates : list of (int, float)
        Iterations done, and the distance estimated then [mm].
    """

    def __init__(
        self,
        points: float,
        amplification: float,
        spare: list[Floats] | None = None,
        *,
        bound: float | None = None,
    ) -> None:
        self._points = points
        self._bound = bound
        self._amplification = amplification
        self._spare = [] if spare is None else spare
        self._taken = 0
        self._kept: list[tuple[int, Floats, float]] = []
        self._x: Floats = np.empty(0)
        self._residual = math.inf
        self._count = 0
        self.distance = math.inf
        self.estimates: list[tuple[int, float]] = []

    def add(self, count: int, x: Floats, residual: float) -> None:
        """Add the iterate of the evaluation with this number (from 1) and its residual [mm]."""
        self._count, self._x, self._residual = count, x, residual
        if self._bound is not None:
            self.distance = self._bound * residual
            self.estimates.append((count, self.distance))
            return
        if count % ESTIMATE_EVERY == 0:
            self._estimate()
        if not self._kept or count >= 1.1 * self._kept[-1][0]:
            stale = [k for k in self._kept if k[0] < 0.5 * LOOK_BACK * count]
            # Reuse the memory of the oldest, if it is too old.
            memory = self._kept.pop(0)[1] if stale else self._memory(x)
            memory[:] = x
            self._kept.append((count, memory, residual))

    def _memory(self, x: Floats) -> Floats:
        if self._taken == len(self._spare):
            self._spare.append(np.empty_like(x))
        self._taken += 1
        return self._spare[self._taken - 1]

    def _estimate(self) -> None:
        earlier = [k for k in self._kept if k[0] < self._count]
        residual = self._residual
        if earlier:
            _, x, before = min(earlier, key=lambda kept: abs(kept[0] - LOOK_BACK * self._count))
            moved = root_mean_square_distance(self._x, x, self._points)
            self.distance = estimate_distance(residual, before, moved, self._amplification)
        else:
            self.distance = self._amplification * residual
        self.estimates.append((self._count, self.distance))

    def finish(self) -> float:
        """Return the estimate at the last iterate (whose array has moved on by one step, which is little)."""
        if not self.estimates or self.estimates[-1][0] != self._count:
            self._estimate()
        return self.distance


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
