"""How fibres lie beside each other: whether they cross at their ends, hook, turn, and what they leave bare.

Neighbours in the middle of a muscle are neighbours at its ends, on the same side of each other: fibres of a
sheet that change from one edge of it to the other do so by crossing all between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import evenly_spaced
from vtkmuscle.core.types import Floats, Ints

#: Places along each fibre at which neighbours are compared; ends are compared with places this far from them.
STATIONS, INWARD = 33, 4
#: Neighbours of each fibre, those nearest to it in the middle: the sides of a square.
NEIGHBOURS = 4
#: Neighbours nearer to each other than this part of what is usual at a place meet there, and are on no side.
MEET = 0.25
#: A turn between two segments beyond which a fibre is hooked [degrees]: it runs back. Where an area lies
#: beside the fibres, they turn onto it by less.
HOOKED = 90.0


@dataclass(frozen=True)
class Arrangement:
    """What is said of fibres at rest.

    Attributes
    ----------
    crossing : float
        Part of all neighbours that change sides in the last eighth of their way, at the worse of both ends.
    hooked : float
        Part of the fibres that turn by more than 90 degrees from one segment to the next.
    turning : float
        Sum of the turns along a fibre, 95th percentile [degrees]: 360 is once round.
    bare : float
        Part of the muscle's volume that is farther from any fibre than neighbours are from each other (the
        median of their mean distance) where that is most, in the belly; 0 for fewer than five fibres.
    """

    crossing: float
    hooked: float
    turning: float
    bare: float


def arrangement(points: Floats, offsets: Ints, samples: Floats) -> Arrangement:
    """Return how fibres lie beside each other.

    Parameters
    ----------
    points, offsets : (n, 3) array, (k + 1,) int array
        Points of all fibres, one after the other [mm]; first point of each fibre, and n.
    samples : (m, 3) array
        Positions of even density in the muscle [mm].

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.fibres.arrangement import arrangement
    >>> x = np.arange(5.0)
    >>> ends = np.stack([np.stack([x, 0 * x, 0 * x], 1), np.stack([x, 0 * x, 0 * x + 9.0], 1)], 1)
    >>> arrangement(ends.reshape(-1, 3), np.arange(0, 11, 2), ends[:, 0]).crossing
    0.0
    """
    fibres = [points[a:b] for a, b in pairwise(offsets)]
    lines = evenly_spaced(points, offsets, STATIONS)
    turns = [_turns(np.diff(fibre, axis=0)) for fibre in fibres]
    near = _neighbours(lines[:, STATIONS // 2])
    away = cKDTree(lines.reshape(-1, 3)).query(samples)[0]
    return Arrangement(
        crossing=max(_crossing(lines, near), _crossing(lines[:, ::-1], near)),
        hooked=float(np.mean([turn.max(initial=0.0) > HOOKED for turn in turns])),
        turning=float(np.percentile([turn.sum() for turn in turns], 95.0)),
        bare=float((away > _spacing(lines, near)).mean()) if len(samples) else 0.0,
    )


def _turns(steps: Floats) -> Floats:
    """Return the angles between a line's steps (k, 3), (k - 1,) [degrees], without those of no length."""
    ahead = unit_vectors(steps[np.linalg.norm(steps, axis=1) > 0.0])
    cosines = (ahead[1:] * ahead[:-1]).sum(axis=1)
    angles: Floats = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    return angles


def _neighbours(middle: Floats) -> Ints:
    """Return the fibres nearest to each by places in the middle (n, 3), (n, 4), or as many as there are."""
    count = min(NEIGHBOURS, len(middle) - 1)
    if count < 1:
        return np.empty((len(middle), 0), dtype=np.int64)
    near = cKDTree(middle).query(middle, count + 1)[1]
    # The fibre itself is among the nearest; where several are in one place, it need not be the first.
    return np.array([row[row != number][:count] for number, row in enumerate(near)])


def _spacing(lines: Floats, near: Ints) -> float:
    """Return how far neighbours are from each other in the belly; infinite where there are too few."""
    if near.shape[1] < NEIGHBOURS:
        return float("inf")
    apart = np.linalg.norm(lines[near] - lines[:, None], axis=-1)
    return float(np.median(apart.mean(axis=1), axis=0).max())


def _crossing(lines: Floats, near: Ints) -> float:
    """Return which part of neighbours change sides between the first of stations and one farther in."""
    ahead = unit_vectors((lines[:, [1, INWARD + 1]] - lines[:, [0, INWARD]]).reshape(-1, 3)).reshape(-1, 2, 3)
    stations = lines[:, [0, INWARD]]
    sides = stations[near] - stations[:, None]
    sides -= (sides * ahead[:, None]).sum(axis=-1, keepdims=True) * ahead[:, None]
    apart = np.linalg.norm(sides, axis=-1)
    if not apart.size:
        return 0.0
    clear = (apart > MEET * np.median(apart, axis=(0, 1))).all(axis=-1)
    changed = (sides[:, :, 0] * sides[:, :, 1]).sum(axis=-1) < 0.0
    return float(changed[clear].mean()) if clear.any() else 0.0
