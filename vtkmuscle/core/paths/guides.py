"""Paths of all fibres from the solved paths of a few, the guides."""

import numpy as np
from scipy.spatial.distance import cdist
from scipy.special import xlogy

from vtkmuscle.core.mesh.sampling import farthest
from vtkmuscle.core.types import ROUNDING, Floats, Ints

#: More paths than any muscle has fibres: all are solved.
ALL_PATHS = 10**6

#: Affine motions of a section need guides at the corners of a tetrahedron.
LEAST_PATHS = 4

#: A direction in which guides spread by less than this part of their greatest spread has no slope: fibres a
#: little beside would be extrapolated far.
FLAT = 1e-3


class Guides:
    """Carry the paths of all fibres by the paths of a few.

    Guides are fibres far from each other by start, middle and end. At each of n stations along the
    fibres, weights interpolate the guides' displacements from the positions to which the bones of the ends
    take the fibres. The interpolant is polyharmonic of least bending with an affine part (thin plate spline;
    Duchon 1977, doi:10.1007/BFb0086566): affine displacements are exact. A direction in which the guides of a
    station do not spread follows the bones.

    fibres : (f, n, 3), points at rest, evenly spread along each fibre [mm];
    start_bones, end_bones : (f,) int, bones of the ends;
    count : number of guides, less than f.

    numbers : (g,) int, the guides, ascending;
    nearest : (f,) int, the nearest guide of each fibre, as an index of ``numbers``.
    """

    def __init__(self, fibres: Floats, start_bones: Ints, end_bones: Ints, count: int) -> None:
        self._fibres, self._ends = fibres, (start_bones, end_bones)
        f, n, _ = fibres.shape
        # Fibres between different bones are farther from each other than any two between the same.
        pairs = np.unique(np.column_stack(self._ends), axis=0, return_inverse=True)[1].reshape(-1)
        bones = np.eye(pairs.max() + 1)[pairs] * 4.0 * np.ptp(fibres, axis=(0, 1)).max()
        places = np.hstack([fibres[:, [0, n // 2, -1]].reshape(f, 9), bones])
        self.numbers: Ints = np.sort(farthest(places, count))
        self.nearest: Ints = cdist(places, places[self.numbers]).argmin(axis=1)
        self._others: Ints = np.setdiff1d(np.arange(f), self.numbers)
        self._weights = np.empty((n, len(self._others), count))
        for station, weights in enumerate(self._weights):
            sites = np.hstack([fibres[:, station], bones])
            weights[:] = thin_plate_weights(sites[self.numbers], sites[self._others])

    def carry(self, guides: Floats, moves: Floats) -> Floats:
        """Return all fibres' points, or velocities, of those of the guides.

        ``guides`` are (g, n, 3); the result is (f, n, 3). ``moves`` (b, 4, 4) take points at rest to where
        the bones take them, or to their velocities with the bones.
        """
        result = with_bones(self._fibres, *self._ends, moves)
        drift = guides - result[self.numbers]
        result[self.numbers] = guides
        result[self._others] += (self._weights @ drift.swapaxes(0, 1)).swapaxes(0, 1)
        return result


def thin_plate_weights(sites: Floats, points: Floats) -> Floats:
    """Return the weights of values at sites for values at points.

    Sites are (g, d), points (p, d), weights (p, g) with rows that sum to 1. Affine functions in the
    directions in which the sites spread are reproduced exactly.
    """
    middle = sites.mean(axis=0)
    spread, axes = np.linalg.svd(sites - middle, full_matrices=False)[1:]
    same = ROUNDING * float(np.abs(sites).max())
    axes = axes[spread > max(FLAT * spread[0], same)]
    size = max(float(spread[0]), same) or 1.0
    affine, at = (np.column_stack([np.ones(len(x)), (x - middle) @ axes.T / size]) for x in (sites, points))
    # The thin plate's r^2 log r; the smoothing has the sign for which the system is definite.
    within, toward = (cdist(x, sites, "sqeuclidean") / size**2 for x in (sites, points))
    bending = xlogy(within, within) + ROUNDING * np.eye(len(sites))
    system = np.block([[bending, affine], [affine.T, np.zeros((len(affine.T),) * 2)]])
    return np.asarray(np.linalg.solve(system, np.hstack([xlogy(toward, toward), at]).T)[: len(sites)].T)


def with_bones(points: Floats, start_bones: Ints, end_bones: Ints, moves: Floats) -> Floats:
    """Return paths moved with bones. Moves (b, 4, 4) are blended from end to end of paths (f, n, 3)."""
    part = np.linspace(0.0, 1.0, points.shape[1])[None, :, None]
    first, last = (
        points @ turn[:, :3, :3].transpose(0, 2, 1) + turn[:, None, :3, 3]
        for turn in (moves[start_bones], moves[end_bones])
    )
    return np.ascontiguousarray(first + part * (last - first))
