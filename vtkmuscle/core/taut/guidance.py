"""What a muscle's solve follows: the stretch of its fibres and the place where they carry its surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.spatial import cKDTree

from vtkmuscle.core.anisotropy import fibre_directions_at
from vtkmuscle.core.mesh import signed_volume
from vtkmuscle.core.taut.carrying import Carried, Carrier
from vtkmuscle.core.taut.paths import TautPaths, TautState
from vtkmuscle.core.topology import MeshTopology

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Part p of a constant volume's thinning that the rest shape has across the fibres: l^(-p / 2) for a stretch
#: l. With 1 all of it would come from the width; a broad muscle, held along its attachments, thins in its
#: thickness instead.
THINNING = 0.5

#: Bounds of the stretch, beyond which no rest shape is sensible (a muscle works between about 0.5 and 1.6).
LEAST_STRETCH, GREATEST_STRETCH = 0.25, 4.0

#: Points of strings that the stretch at an edge is a mean of, at most.
_NEIGHBOURS = 48


@dataclass(frozen=True, eq=False)
class Guided:
    """What a muscle follows in one pose.

    Attributes
    ----------
    state : TautState
        The strings.
    stretch : (k,) array
        Length of the strings beside each edge, by that at rest.
    carried : Carried
        The muscle where its strings carry it.
    """

    state: TautState
    stretch: Floats
    carried: Carried

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        return self.state.nbytes + self.stretch.nbytes + self.carried.nbytes


class Guidance:
    """Taut strings in a muscle, and what they say of its surface.

    Parameters
    ----------
    paths : TautPaths
        The strings.
    surface : (v, 3) array
        The muscle at rest [mm].
    topology : MeshTopology
        Of its surface.
    fixed_to : (v,) int array
        Bone that each point is fixed to, -1 for free ones.

    Attributes
    ----------
    directions : (k, 3) array
        Unit direction of the fibres at each edge at rest.
    """

    def __init__(self, paths: TautPaths, surface: Floats, topology: MeshTopology, fixed_to: Ints) -> None:
        self.paths = paths
        self._carrier = Carrier(paths, surface, topology.triangles, fixed_to, thinning=THINNING)
        middles = surface[topology.edges].mean(axis=1)
        f, n, _ = paths.fibres.shape
        points = paths.fibres.reshape(-1, 3)
        self.directions: Floats = fibre_directions_at(middles, points, n * np.arange(f + 1))
        near, found = cKDTree(points).query(middles, k=range(1, min(_NEIGHBOURS, len(points)) + 1))
        spacing = self._spacing(surface, topology)
        # The last neighbour counts nothing: of two equally far ones rounding would choose which is found.
        shares = np.exp((near[:, :1] ** 2 - near**2) / (2.0 * spacing**2))
        shares = np.where(shares > shares[:, -1:], shares - shares[:, -1:], 0.0) + np.finfo(float).tiny
        shares /= shares.sum(axis=1, keepdims=True)
        rows = np.repeat(np.arange(len(middles)), shares.shape[1])
        shape = len(middles), f
        self._weights: csr_array = coo_array((shares.reshape(-1), (rows, found.reshape(-1) // n)), shape).tocsr()

    def _spacing(self, surface: Floats, topology: MeshTopology) -> float:
        """Return the distance between strings that fill the muscle evenly [mm]."""
        volume = abs(signed_volume(surface, topology.triangles))
        return float(np.sqrt(volume / self.paths.rest.lengths.sum()))

    def follow(self, before: TautState | None, transforms: Floats) -> Guided:
        """Return what the muscle follows in a pose.

        Parameters
        ----------
        before : TautState or None
            The strings in the pose before; None at rest.
        transforms : (b, 4, 4) array
            Of the bones, rest to now.
        """
        state = self.paths.follow(self.paths.rest if before is None else before, transforms)
        # About 1, so that weights whose sum is rounded leave the rest shape as it is.
        longer = state.lengths / self.paths.rest.lengths - 1.0
        stretch = np.clip(1.0 + self._weights @ longer, LEAST_STRETCH, GREATEST_STRETCH)
        return Guided(state, stretch, self._carrier.at(state))

    def fibre_weights(self, points: Floats, offsets: Ints) -> tuple[Ints, Floats]:
        """Return what carries points of the fibres; see :meth:`Carrier.fibre_weights`."""
        return self._carrier.fibre_weights(points, offsets)
