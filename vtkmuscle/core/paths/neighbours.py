"""Neighbouring paths, held together like muscle tissue."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.types import Floats, Ints

#: Young's modulus of muscle across its fibres, as a part of the tension per area along them. Of passive
#: muscle it is 0.1: 22 kPa (rabbit extensor digitorum longus; Morrow et al. 2010,
#: doi:10.1016/j.jmbbm.2009.03.004) of 225 kPa, the specific tension of human muscle. Muscle under tension is
#: stiffer, up to about as stiff as it is tense: this is the mean of 0.1 and 1, as ratios. What half and
#: double change is in the documentation.
MODULUS = 0.3

#: Shear modulus of muscle along its fibres, likewise: 3.87 kPa (Morrow et al. 2010) of 225 kPa.
SHEAR_MODULUS = 0.017

#: Neighbours of a path in a section: those that a point of an even pattern has.
NEIGHBOURS = 6

#: Points beside one that are looked at for these: some may be in the same place.
LOOKED_AT = 32

#: Two points nearer than this part of the median distance are as stiff as two so far apart: where paths meet
#: in a tendon's end a strain would be of nothing.
LEAST_SPACING = 0.5

#: Points nearer than this part of the median distance do not hold each other: where lines run together, their
#: last digits would say in which direction.
TOO_NEAR = 0.01

#: Bounds of a path's stretch, beyond which none is sensible (a muscle works between about 0.5 and 1.6).
LEAST_STRETCH, GREATEST_STRETCH = 0.25, 4.0

#: Distances that differ by less than this part of the greater, or of a path's length, are the same.
SAME = 1e-9


class Neighbours(NamedTuple):
    """Pairs of points that keep their distance.

    The pairs belong to a sheet, and resist shear.

    Attributes
    ----------
    pairs : (m, 2) int array
        Numbers of points, in the order of paths.
    stations : (m,) int array
        Number of both points of a pair along their paths.
    distances, ahead : (m,) arrays
        Distances at rest, across the paths and along the paths, of the first point from the second [mm].
    stiffness : (m, 2) array
        Across and along, in stiffnesses of a path's springs [1].
    """

    pairs: Ints
    stations: Ints
    distances: Floats
    ahead: Floats
    stiffness: Floats


def neighbours_of(fibres: Floats) -> Neighbours:
    """Return the pairs of neighbouring points of fibres.

    Fibres are (f, n, 3); the points of a pair are equally far along. A pair strained by e has the energy
    m (L e)^2 / 2 per length of path, of a path of length L with a tension of 1 per length: m is
    :data:`MODULUS`, and of the shear e :data:`SHEAR_MODULUS`. As paths shorten by l, the kept distances grow
    by l^(-1/2): the muscle keeps its volume. The numbers of paths and of points on each do not matter.
    """
    f, n, _ = fibres.shape
    length = float(path_lengths(fibres).mean())
    found = []
    for i in range(1, n - 1):
        tree = cKDTree(fibres[:, i])
        near = tree.query(fibres[:, i], k=range(1, min(LOOKED_AT, f) + 1))[0]
        # Lines that have run together count once: rounding would say in which direction they are apart.
        apart = near > SAME * length
        reach = np.where(apart & (apart.cumsum(axis=1) <= NEIGHBOURS), near, 0.0).max(axis=1)
        # Of those equally far none is left out: the order of the fibres would choose.
        beside = tree.query_ball_point(fibres[:, i], (1.0 + SAME) * reach)
        both = np.stack(
            [np.repeat(np.arange(f), [len(one) for one in beside]), np.concatenate(beside)], axis=1
        )
        both = np.unique(np.sort(both[both[:, 0] != both[:, 1]], axis=1), axis=0)
        found.append(both * n + i)
    pairs = np.concatenate(found) if found else np.empty((0, 2), dtype=np.int64)
    points = fibres.reshape(-1, 3)
    one, other = pairs.T
    along = points[np.minimum(one + 1, len(points) - 1)] - points[one - 1]
    along += points[np.minimum(other + 1, len(points) - 1)] - points[other - 1]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
    ways = points[one] - points[other]
    ahead = np.einsum("mi,mi->m", ways, along)
    ways -= ahead[:, None] * along
    distances = np.linalg.norm(ways, axis=1)
    usual = float(np.median(distances)) if len(distances) else 0.0
    apart = (distances > SAME * length) & (distances > TOO_NEAR * usual)
    pairs, distances = pairs[apart], distances[apart]
    spacing = np.maximum(distances, LEAST_SPACING * usual)
    stiffness = (length / (spacing * (n - 1))) ** 2
    moduli = np.outer(stiffness, (MODULUS, SHEAR_MODULUS))
    return Neighbours(pairs, pairs[:, 0] % n, distances, ahead[apart], moduli)


def path_lengths(points: Floats) -> Floats:
    """Return the lengths of paths (f, n, 3), (f,) [mm]."""
    steps = points[:, 1:] - points[:, :-1]
    lengths: Floats = np.sqrt(np.einsum("fni,fni->fn", steps, steps)).sum(axis=1)
    return lengths


def path_widths(points: Floats, lengths: Floats) -> Floats:
    """Return the widths of paths relative to rest, (f,).

    ``lengths`` (f,) are at rest; the paths keep their volume.
    """
    stretch = path_lengths(points) / lengths
    widths: Floats = 1.0 / np.sqrt(stretch.clip(LEAST_STRETCH, GREATEST_STRETCH))
    return widths


def widening(points: Floats, lengths: Floats) -> Floats:
    """Return the change of :func:`path_widths` with length.

    Paths are (f, n, 3), the result (f,) [1/mm].
    """
    widths = path_widths(points, lengths)
    within = (widths > GREATEST_STRETCH**-0.5) & (widths < LEAST_STRETCH**-0.5)
    change: Floats = np.where(within, -0.5 * widths**3 / lengths, 0.0)
    return change
