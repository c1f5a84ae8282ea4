"""How far each point of a muscle is from a bone: near enough to be tested again, or not."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.motion.rigid import inverse
from vtkmuscle.core.types import Floats


class Clearance:
    """How far points were from a bone when they were last looked at.

    That is a matter of where they were beside the bone: as the bone moves on, what is known moves with it.

    Parameters
    ----------
    n_points : int
        How many there are. None of them has been looked at yet.

    Attributes
    ----------
    seen_at : (n, 3) array
        Where each point was [mm].
    squares : (n,) array
        Square of the way that it can go from there without meeting the bone's skin [mm^2].
    """

    def __init__(self, n_points: int) -> None:
        self.seen_at: Floats = np.zeros((n_points, 3))
        self.squares: Floats = np.zeros(n_points)
        self._bone: Floats = np.eye(4)
        self._to_rest: tuple[Floats, Floats] | None = None

    def to_rest(self, bone: Floats) -> Floats:
        """Return the inverse of where the bone is; one array is inverted once, however often it comes."""
        if self._to_rest is None or self._to_rest[0] is not bone:
            self._to_rest = bone, inverse(bone)
        return self._to_rest[1]

    def begin(self, bone: Floats, step: Floats, x: Floats) -> None:
        """Begin a step.

        Parameters
        ----------
        bone : (4, 4) array
            Where it is now.
        step : (4, 4) array
            Motion of the bone from the previous frame to now.
        x : (n, 3) array
            Positions of the previous frame [mm]; the ways of the points begin there.
        """
        _carry(bone @ inverse(self._bone), step, x, self.seen_at, self.squares)
        self._bone = bone


@kernel
def _carry(since: Floats, step: Floats, x: Floats, seen_at: Floats, squares: Floats) -> None:
    """Move where points were seen with the bone, and forget those that begin their ways farther off.

    since, step : (4, 4), motions of the bone since they were seen, and in this step.
    """
    for i in range(len(squares)):
        if squares[i] == 0.0:
            continue
        a, b, c = seen_at[i, 0], seen_at[i, 1], seen_at[i, 2]
        way = 0.0
        for k in range(3):
            seen_at[i, k] = since[k, 0] * a + since[k, 1] * b + since[k, 2] * c + since[k, 3]
            start = step[k, 0] * x[i, 0] + step[k, 1] * x[i, 1] + step[k, 2] * x[i, 2] + step[k, 3]
            way += (start - seen_at[i, k]) ** 2
        if not way < squares[i]:
            squares[i] = 0.0
