"""The linear blend of Modenese and Kohout 2020 that keeps fibres out of the bones best."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from vtkmuscle.core.motion.blending import blend_fibres
from vtkmuscle.core.types import Floats, Ints

#: Values of a that are looked at: beyond them weights leave [0, 1].
LARGEST_A = 1.0
#: Mean depths that differ by no more than this are equal [mm].
EQUALLY_GOOD = 1e-6
#: Steps of the first look, and of each closer one around the best.
_STEPS = 21
_LOOKS = 3


def fitted_a(
    points: Floats,
    offsets: Ints,
    poses: Sequence[tuple[Floats, Floats]],
    depth: Callable[[int, Floats], Floats],
    *,
    largest: float = LARGEST_A,
) -> tuple[float, float]:
    """Return the a with which fibres enter the bones least over some poses, and their mean depth then [mm].

    The sum over all points and poses of the depth in a bone is searched on [-largest, largest], closer and
    closer around the best. Of values that are equally good the one nearest to 0 is taken.

    There need not be a minimum within: where a bone is in the way of one end only, fibres enter it the less
    the more they follow the bone of the other end, and the best a is at the bound. So it is for the iliacus
    over hip flexion, with weights 1 - t^2: fibres stay by the pelvis for most of their length, and all of the
    motion is taken up near the insertion. At 90 degrees its fibres are 0.86 mm deep on the mean with a = -1,
    2.87 mm with -0.042 and 2.96 mm with 0: values like the papers, found by trial, hardly change how
    deep they are.

    Parameters
    ----------
    points, offsets
        As of :func:`blend_fibres`.
    poses : sequence of (origin, insertion)
        Motions of the two bones, (4, 4) arrays each, rest to then.
    depth : callable
        From the number of a pose and points (n, 3) to how deep each is in a bone, (n,), 0 outside [mm].
    largest : float, optional
        Bound of abs(a), in (0, 1].

    Returns
    -------
    a, depth : float
        See above.
    """

    def cost(a: float) -> float:
        blended = (blend_fibres(points, offsets, *pose, a) for pose in poses)
        return sum(float(depth(i, moved).mean()) for i, moved in enumerate(blended)) / max(len(poses), 1)

    best, least, reach = 0.0, cost(0.0), largest
    for _ in range(_LOOKS):
        around = np.clip(best + np.linspace(-reach, reach, _STEPS), -largest, largest)
        for a in sorted(around.tolist(), key=abs):
            now = cost(a)
            better = now < least - EQUALLY_GOOD
            if better or (now < least + EQUALLY_GOOD and abs(a) < abs(best)):
                best, least = a, now
        reach *= 2.0 / (_STEPS - 1)
    return best, least
