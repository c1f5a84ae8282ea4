"""The rest lengths and angles of a muscle that is stretched along its fibres."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.constraints import dihedral_angle
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.topology import MeshTopology

Floats = NDArray[np.float64]


class StretchedShape:
    """A rest shape that is stretched along the fibres, around each edge by as much as is said for it.

    Around an edge the rest shape is stretched by F = g I + (l - g) v v^T, with l the stretch along the
    fibres' direction v and g = l^(-thinning / 2) across. So an edge at the angle a to the fibres has
    d' = d sqrt(l^2 cos^2 a + g^2 sin^2 a). The normals of the triangles beside it go by the cofactors of F,
    g (l I + (g - l) v v^T), and their scalar triple product by det F = g^2 l. With unit normals m and n at
    rest, at the dihedral angle p, the angle p' then is that of

        cos p' : sin p' = l^2 cos p + (g^2 - l^2) (m . v) (n . v) : l (d' / d) sin p,

    in which all but l, g and d' is known beforehand.

    Parameters
    ----------
    rest : (n, 3) array
        Positions at rest [mm].
    topology : MeshTopology
        Of the surface.
    directions : (k, 3) array
        v at each edge; where it is 0, F is g I.
    thinning : float
        In [0, 1]; 1 is a constant volume.
    """

    def __init__(self, rest: Floats, topology: MeshTopology, directions: Floats, *, thinning: float) -> None:
        edges, quads, at = topology.edges, topology.quads, topology.quad_edges
        k = len(edges)
        along = rest[edges[:, 1]] - rest[edges[:, 0]]
        self._lengths: Floats = np.linalg.norm(along, axis=1)
        self._thinning = thinning
        slope = np.einsum("ij,ij->i", along, directions)
        self._squares = np.divide(slope, self._lengths, out=np.zeros(k), where=self._lengths > 0) ** 2
        self._directed = (directions != 0.0).any(axis=1)
        corners = [rest[quads[:, c]] for c in range(4)]
        angles, defined = dihedral_angle(*corners)
        e = corners[1] - corners[0]
        normals = [np.cross(e, corners[2] - corners[0]), np.cross(corners[3] - corners[0], e)]
        self._cosines, self._sines, self._slopes = np.ones(k), np.zeros(k), np.zeros(k)
        bent = at[defined]
        self._cosines[bent], self._sines[bent] = np.cos(angles[defined]), np.sin(angles[defined])
        slopes = [
            np.einsum("ij,ij->i", n[defined], directions[bent]) / np.linalg.norm(n[defined], axis=1)
            for n in normals
        ]
        self._slopes[bent] = slopes[0] * slopes[1]

    def at(self, stretch: Floats) -> tuple[Floats, Floats, Floats]:
        """Return what the rest shape is stretched to.

        Parameters
        ----------
        stretch : (k,) array
            l at each edge, > 0.

        Returns
        -------
        lengths, cosines, sines : (k,) arrays
            Of the edges [mm], and of the dihedral angles at them; 1 and 0 where there is none.
        """
        result = np.empty((3, len(stretch)))
        _stretch(
            self._lengths,
            self._squares,
            self._cosines,
            self._sines,
            self._slopes,
            self._directed,
            stretch,
            stretch ** (-0.5 * self._thinning),
            result,
        )
        return result[0], result[1], result[2]


@kernel
def _stretch(
    lengths: Floats,
    squares: Floats,
    cosines: Floats,
    sines: Floats,
    slopes: Floats,
    directed: NDArray[np.bool_],
    stretch: Floats,
    across: Floats,
    result: Floats,
) -> None:
    """Do what :meth:`StretchedShape.at` says: squares are cos^2 a, slopes (m . v) (n . v), across g."""
    for i in range(len(lengths)):
        g = across[i]
        stretched = stretch[i] if directed[i] else g
        g2, l2 = g * g, stretched * stretched
        longer = math.sqrt(g2 + (l2 - g2) * squares[i])
        cosine = l2 * cosines[i] + (g2 - l2) * slopes[i]
        sine = stretched * longer * sines[i]
        size = 1.0 / math.sqrt(cosine * cosine + sine * sine)
        result[0, i], result[1, i], result[2, i] = longer * lengths[i], cosine * size, sine * size
