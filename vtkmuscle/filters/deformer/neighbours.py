"""Neighbouring muscles: surfaces in a pose, and overlap depths at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.neighbours import Neighbour
from vtkmuscle.core.mesh.surface import signed_volume
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import blocks_of, checked_surface, point_array


class Neighbours:
    """The neighbours of one muscle over time.

    Parameters
    ----------
    rest : (n, 3) array
        The muscle at rest [mm].
    """

    def __init__(self, rest: Floats) -> None:
        self._rest = rest
        self._allowances: dict[int, Floats] = {}

    def at(self, muscles: vtkMultiBlockDataSet) -> list[Neighbour]:
        """Return the neighbours in the pose of a data set.

        Raises
        ------
        ValueError
            If a block is not a surface of triangles, or has no point array ``Displacement``.
        """
        neighbours = []
        for number, (name, block) in enumerate(blocks_of(muscles)):
            where = f"neighbours, block {name!r}"
            if not isinstance(block, vtkPolyData):
                raise InputError(where, "it is no vtkPolyData", "connect outputs of PBDDeformer")
            points, triangles = checked_surface(block, where)
            if number not in self._allowances:
                displacement = np.array(point_array(block, "Displacement", where))
                rest = outward_tree(points - displacement, triangles)
                self._allowances[number] = rest.depth(self._rest)
            neighbours.append(Neighbour(outward_tree(points, triangles), self._allowances[number]))
        return neighbours


def outward_tree(points: Floats, triangles: NDArray[np.int64]) -> TriangleTree:
    """Return the hierarchy of a closed surface with outward triangles."""
    if signed_volume(points, triangles) < 0.0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    return triangle_tree(points, triangles)
