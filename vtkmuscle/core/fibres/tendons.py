"""Fibres between aponeuroses in motion: their ends stay as far from the bones, for tendon is stiff.

A tendon is longer by 3.3 % at its muscle's largest force (Zajac 1989, *Muscle and tendon*, Critical Reviews
in Biomedical Engineering 17, 359-411), while fibres may shorten by half. So the change of a path's length is
the change of the fibres' length.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.skinning.skinning import falling_weights
from vtkmuscle.core.types import Bools, Floats

#: Nearest points of paths whose paths hold an end.
BESIDE = 8
#: A fibre is straight whose points are nearer to its chord than this part of its length.
STRAIGHT = 1e-6


class Tendons:
    """The ends of fibres, held as far from their bones, along the paths beside them, as at rest.

    Parameters
    ----------
    fibres : (k, r, 3) array
        At rest, from the aponeurosis on the side of the origin to the other one [mm].
    paths : (p, n, 3) array
        Of the muscle at rest, from bone to bone [mm].
    fixed : (k, 2) bool array
        Ends on a part of the muscle that is fixed to a bone: they stay with that part.
    """

    def __init__(self, fibres: Floats, paths: Floats, fixed: Bools) -> None:
        self._share = np.linspace(0.0, 1.0, fibres.shape[1])[:, None]
        bow = np.linalg.norm(fibres - self._chords(fibres[:, 0], fibres[:, -1]), axis=2).max(axis=1)
        self._bent = bow > STRAIGHT * np.linalg.norm(fibres[:, -1] - fibres[:, 0], axis=1)
        self._free = ~fixed
        self._sides = [_EndNeighbours(fibres[:, end], paths[:, :: -1 if end else 1]) for end in (0, -1)]

    def held(self, carried: Floats, paths: Floats) -> Floats:
        """Return fibres (k, r, 3) whose ends keep their distance along paths (p, n, 3) [mm].

        Those that were straight at rest stay straight.
        """
        ends = [
            np.where(free[:, None], beside.places(paths[:, :: -1 if end else 1]), carried[:, end])
            for end, free, beside in zip((0, -1), self._free.T, self._sides, strict=True)
        ]
        bows = carried - self._chords(carried[:, 0], carried[:, -1])
        return self._chords(*ends) + np.where(self._bent[:, None, None], bows, 0.0)

    def _chords(self, starts: Floats, ends: Floats) -> Floats:
        return (1.0 - self._share) * starts[:, None] + self._share * ends[:, None]


class _EndNeighbours:
    """Positions of fibre ends (m, 3) relative to neighbouring paths (p, n, 3) at rest."""

    def __init__(self, ends: Floats, paths: Floats) -> None:
        nodes, n = paths.reshape(-1, 3), paths.shape[1]
        apart, near = cKDTree(nodes).query(ends, range(1, min(BESIDE, len(nodes)) + 1))
        self._paths, self._weights = near // n, falling_weights(apart, np.finfo(float).tiny)
        starts, lengths, ahead = _segments(paths[self._paths])
        since = ends[:, None, None] - paths[self._paths][:, :, :-1]
        low, high = np.zeros(n - 1), lengths.copy()
        low[0], high[..., -1] = -np.inf, np.inf
        part = np.clip((since * ahead).sum(axis=-1), low, high)
        nearest = ((since - part[..., None] * ahead) ** 2).sum(axis=-1).argmin(axis=-1)[..., None]
        self._arcs = np.take_along_axis(starts + part, nearest, axis=-1)[..., 0]
        places, self._ahead = self._along(paths)
        self._offsets = ends[:, None] - places

    def places(self, paths: Floats) -> Floats:
        """Return the ends (m, 3), as far along paths as at rest, their offsets turned with the paths."""
        places, ahead = self._along(paths)
        axis, cosine = np.cross(self._ahead, ahead), (self._ahead * ahead).sum(axis=-1, keepdims=True)
        about = (axis * self._offsets).sum(axis=-1, keepdims=True) / np.maximum(1.0 + cosine, 1e-3)
        turned = cosine * self._offsets + np.cross(axis, self._offsets) + about * axis
        result: Floats = (self._weights[..., None] * (places + turned)).sum(axis=1)
        return result

    def _along(self, paths: Floats) -> tuple[Floats, Floats]:
        """Return places (m, c, 3) on paths, and the directions there over a segment to either side."""
        points = paths[self._paths]
        starts, lengths, ahead = _segments(points)

        def at(arcs: Floats) -> Floats:
            which = np.maximum((starts <= arcs[..., None]).sum(axis=-1) - 1, 0)[..., None, None]
            since = arcs[..., None] - np.take_along_axis(starts, which[..., 0], axis=-1)
            begin, on = (np.take_along_axis(x, which, axis=2)[:, :, 0] for x in (points[:, :, :-1], ahead))
            places: Floats = begin + since * on
            return places

        reach = lengths.mean(axis=-1)
        way = at(self._arcs + reach) - at(self._arcs - reach)
        return at(self._arcs), unit_vectors(way.reshape(-1, 3)).reshape(way.shape)


def _segments(paths: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the arcs at which segments of paths (..., n, 3) begin, their lengths and their directions."""
    steps = np.diff(paths, axis=-2)
    lengths = np.linalg.norm(steps, axis=-1)
    ahead = unit_vectors(steps.reshape(-1, 3)).reshape(steps.shape)
    return np.cumsum(lengths, axis=-1) - lengths, lengths, ahead
