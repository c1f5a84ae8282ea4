"""Stiff tendons: fibre ends keep their distance to the bones.

A tendon is longer by 3.3 % at the largest force of its muscle (Zajac 1989, *Muscle and tendon*, Critical
Reviews in Biomedical Engineering 17, 359-411), while fibres may shorten by half. So a path and its fibres
change their lengths alike.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import curve_segments
from vtkmuscle.core.skinning.skinning import falling_weights
from vtkmuscle.core.types import Bools, Floats

#: Number of path points in the weighted mean that places a fibre end.
N_NEIGHBOURS = 8
#: Largest distance of a straight fibre's points from its chord, as a part of the fibre's length.
STRAIGHT = 1e-6


class Tendons:
    """Fibre ends at constant distances from bones, along paths.

    fibres : (k, r, 3), fibres at rest, from the aponeurosis on the origin's side to the opposite aponeurosis
        [mm];
    paths : (p, n, 3), paths of the muscle at rest, from bone to bone [mm];
    fixed : (k, 2), ends on a part of the muscle that is fixed to a bone, and moves with the bone.
    """

    def __init__(self, fibres: Floats, paths: Floats, fixed: Bools) -> None:
        self._share = np.linspace(0.0, 1.0, fibres.shape[1])[:, None]
        bow = np.linalg.norm(fibres - self._chords(fibres[:, 0], fibres[:, -1]), axis=2).max(axis=1)
        self._bent = bow > STRAIGHT * np.linalg.norm(fibres[:, -1] - fibres[:, 0], axis=1)
        self._free = ~fixed
        self._sides = [_EndNeighbours(fibres[:, end], paths[:, :: -1 if end else 1]) for end in (0, -1)]

    def placed(self, carried: Floats, paths: Floats) -> Floats:
        """Return carried fibres (k, r, 3) with placed ends.

        Ends keep their rest distance along paths (p, n, 3) [mm].

        Fibres that are straight at rest stay straight.
        """
        ends = [
            np.where(free[:, None], side.positions(paths[:, :: -1 if end else 1]), carried[:, end])
            for end, free, side in zip((0, -1), self._free.T, self._sides, strict=True)
        ]
        bows = carried - self._chords(carried[:, 0], carried[:, -1])
        return self._chords(*ends) + np.where(self._bent[:, None, None], bows, 0.0)

    def _chords(self, starts: Floats, ends: Floats) -> Floats:
        return (1.0 - self._share) * starts[:, None] + self._share * ends[:, None]


class _EndNeighbours:
    """Positions of fibre ends relative to neighbouring paths. Ends (m, 3), paths (p, n, 3) at rest."""

    def __init__(self, ends: Floats, paths: Floats) -> None:
        nodes, n = paths.reshape(-1, 3), paths.shape[1]
        apart, nearest_nodes = cKDTree(nodes).query(ends, range(1, min(N_NEIGHBOURS, len(nodes)) + 1))
        self._paths, self._weights = nearest_nodes // n, falling_weights(apart, np.finfo(float).tiny)
        starts, lengths, ahead = curve_segments(paths[self._paths])
        since = ends[:, None, None] - paths[self._paths][:, :, :-1]
        low, high = np.zeros(n - 1), lengths.copy()
        low[0], high[..., -1] = -np.inf, np.inf
        part = np.clip((since * ahead).sum(axis=-1), low, high)
        nearest = ((since - part[..., None] * ahead) ** 2).sum(axis=-1).argmin(axis=-1)[..., None]
        self._arcs = np.take_along_axis(starts + part, nearest, axis=-1)[..., 0]
        feet, self._ahead = self._along(paths)
        self._offsets = ends[:, None] - feet

    def positions(self, paths: Floats) -> Floats:
        """Return the ends (m, 3) at their rest arcs. Offsets turn with the paths."""
        feet, ahead = self._along(paths)
        axis, cosine = np.cross(self._ahead, ahead), (self._ahead * ahead).sum(axis=-1, keepdims=True)
        about = (axis * self._offsets).sum(axis=-1, keepdims=True) / np.maximum(1.0 + cosine, 1e-3)
        turned = cosine * self._offsets + np.cross(axis, self._offsets) + about * axis
        return np.asarray((self._weights[..., None] * (feet + turned)).sum(axis=1))

    def _along(self, paths: Floats) -> tuple[Floats, Floats]:
        """Return feet (m, c, 3) on paths, and directions. Directions span a segment to either side."""
        points = paths[self._paths]
        starts, lengths, ahead = curve_segments(points)

        def at(arcs: Floats) -> Floats:
            segment = np.maximum((starts <= arcs[..., None]).sum(axis=-1) - 1, 0)[..., None, None]
            since = arcs[..., None] - np.take_along_axis(starts, segment[..., 0], axis=-1)
            begin, on = (np.take_along_axis(x, segment, axis=2)[:, :, 0] for x in (points[:, :, :-1], ahead))
            return np.asarray(begin + since * on)

        reach = lengths.mean(axis=-1)
        return at(self._arcs), unit_vectors(at(self._arcs + reach) - at(self._arcs - reach))
