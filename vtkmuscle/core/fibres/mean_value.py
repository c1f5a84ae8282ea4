"""Mean value coordinates of points in a closed triangle mesh."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.mean_value_lanes import LANES, MeshArrays, weights_of_lanes
from vtkmuscle.core.machine import processors
from vtkmuscle.core.types import Floats, Ints

#: A query point nearer than this to a vertex, an edge or a triangle lies on it; share of the mesh's diagonal.
ON_SURFACE = 1e-13
#: Weights that miss their own point by more than this share of the diagonal come from an open surface.
LARGEST_RESIDUAL = 1e-6


def mean_value_coordinates(points: Floats, triangles: Ints, queries: Floats, *, threads: int = 0) -> Floats:
    """Return the weights that express points by the vertices of a closed triangle mesh.

    Ju, Schaefer, Warren 2005, *Mean value coordinates for closed triangular meshes*
    (doi:10.1145/1073204.1073229). The weights of a point sum to 1 and reproduce linear functions; they are
    barycentric on the surface and defined outside of it as well.

    Parameters
    ----------
    points : (n, 3) array
        Vertices of the mesh [mm].
    triangles : (m, 3) int array
        Point ids. Triangles without area contribute nothing; which side is out does not matter.
    queries : (q, 3) array
        Where to evaluate, inside or outside of the mesh [mm].
    threads : int, optional
        Number of threads, 0 for one per processor. The result does not depend on it.

    Returns
    -------
    (q, n) array
        A row of weights per query point [1].

    Raises
    ------
    ValueError
        If the weights of a point do not reproduce it: the surface is not closed, its triangles are not
        oriented alike, or the point is too far away.
    """
    return weights_of(coordinate_mesh(points, triangles), queries, threads)


@dataclass(frozen=True, eq=False)
class CoordinateMesh:
    """The data of a mesh that all query points share."""

    centre: Floats
    diagonal: float
    arrays: MeshArrays


def coordinate_mesh(points: Floats, triangles: Ints) -> CoordinateMesh:
    """Return the data of a mesh that all query points share."""
    centre = points.mean(axis=0) if len(points) else np.zeros(3)
    vertices = points - centre
    corners = vertices[triangles]
    sides = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]  # number i is opposite to corner i
    normals = np.cross(sides[:, 0], sides[:, 1])
    double_areas = np.linalg.norm(normals, axis=1)
    squares = (sides**2).sum(axis=2)
    proper = double_areas > np.finfo(np.float64).eps * squares.max(axis=1, initial=0.0)
    triangles, sides, double_areas, squares = (
        array[proper] for array in (triangles, sides, double_areas, squares)
    )
    normals = normals[proper] / double_areas[:, None]
    used = vertices[np.unique(triangles)]
    if not len(used):
        raise InputError("mean value coordinates", "the mesh has no triangle with an area")
    one, two, three = sides[:, 0], sides[:, 1], sides[:, 2]
    products = np.stack(
        [(one * two).sum(axis=1), (one * three).sum(axis=1), (two * three).sum(axis=1)], axis=1
    )
    constants = np.column_stack(
        [
            normals,
            np.cross(two, normals),
            np.cross(three, normals),
            double_areas,
            products / double_areas[:, None],
            squares,
        ]
    )
    arrays = MeshArrays(
        np.ascontiguousarray(vertices, dtype=np.float64),
        np.ascontiguousarray(triangles, dtype=np.int64),
        constants,
        vertices @ np.linalg.pinv(vertices.T @ vertices),
    )
    return CoordinateMesh(centre, float(np.linalg.norm(np.ptp(used, axis=0))), arrays)


def weights_of(mesh: CoordinateMesh, queries: Floats, threads: int, *, first: int = 0) -> Floats:
    """Return the weights (q, n) of points, computed in threads; numbered from `first` on where they fail."""
    centred = queries - mesh.centre
    weights, residuals = np.empty((len(queries), len(mesh.arrays.vertices))), np.empty(len(queries))

    def work(begin: int) -> None:
        rows = slice(begin, begin + LANES)
        tolerance = mesh.diagonal * ON_SURFACE
        weights[rows], residuals[rows] = weights_of_lanes(mesh.arrays, centred[rows], tolerance)

    with ThreadPoolExecutor(threads or processors()) as pool:
        list(pool.map(work, range(0, len(queries), LANES)))
    bad = np.flatnonzero(~(residuals <= LARGEST_RESIDUAL * mesh.diagonal))
    if len(bad):
        raise InputError(
            "mean value coordinates",
            f"{len(bad)} point(s), the first is number {first + bad[0]}, are not reproduced by their weights",
            "the surface must be closed and its triangles oriented alike, and the points must not be many "
            "times its size away from it",
        )
    return weights


def transport(weights: Floats, points: Floats) -> Floats:
    """Return the points that weights make of vertices, v_i = sum_j w_ij p_j.

    Kohout, Cervenka 2021, eq. 8 (doi:10.1007/978-3-030-72379-8_24). Taken about the centre of the vertices,
    so that a mesh far from the origin loses no digits.

    Parameters
    ----------
    weights : (q, n) array
        Rows that sum to 1.
    points : (n, 3) array
        Vertices, as many as when the weights were computed [mm].

    Returns
    -------
    (q, 3) array
        Positions [mm].
    """
    centre = points.mean(axis=0)
    moved: Floats = weights @ (points - centre) + centre
    return moved
