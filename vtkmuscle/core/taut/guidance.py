"""What a muscle's solve follows: its taut fibres, and its surface where they carry it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.mesh.segments import fibre_directions_at
from vtkmuscle.core.mesh.topology import MeshTopology
from vtkmuscle.core.taut.carrying import Carried, Carrier, Passengers
from vtkmuscle.core.taut.paths import TautPaths, TautState
from vtkmuscle.core.types import Floats, Ints


@dataclass(frozen=True, eq=False)
class Guided:
    """What a muscle follows in one pose.

    Attributes
    ----------
    state : TautState
        The strings.
    carried : Carried
        The muscle where its strings carry it.
    """

    state: TautState
    carried: Carried

    @property
    def nbytes(self) -> int:
        """Memory that it takes [bytes]."""
        return self.state.nbytes + self.carried.nbytes


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
        self._carrier = Carrier(paths, surface, fixed_to)
        middles = surface[topology.edges].mean(axis=1)
        f, n, _ = paths.fibres.shape
        points = paths.fibres.reshape(-1, 3)
        self.directions: Floats = fibre_directions_at(middles, points, n * np.arange(f + 1))

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
        return Guided(state, self._carrier.at(state))

    def fibres(self, points: Floats, offsets: Ints) -> Passengers:
        """Return points of the fibres as what the strings carry; see :meth:`Carrier.fibres`."""
        return self._carrier.fibres(points, offsets)
