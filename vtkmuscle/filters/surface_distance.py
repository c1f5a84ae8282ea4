"""Exact distances from a triangle surface, and how deep points are inside it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkDoubleArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance

from vtkmuscle.core.mesh import half_edges, point_components, signed_volume
from vtkmuscle.core.voxels import VoxelGrid, build_voxel_grid
from vtkmuscle.filters.arrays import checked_surface, surface_from

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Cells of the grid that sorts out points which cannot be inside.
_SIEVE_CELLS = 64**3


class SurfaceDistance:
    """Distances of points from the triangles of a surface (not from a grid or a sampling of them).

    Each connected shell has an inside of its own, whether its triangles face outward or inward: where
    shells overlap, as the bones of a pelvis do, and for a hollow in a bone, which counts as filled. The
    sign is that of the angle-weighted normal at the closest point, exact for closed manifold shells of any
    genus.

    Parameters
    ----------
    surface : vtkPolyData
        Triangles; closed where :meth:`depth` is asked for.

    Raises
    ------
    ValueError
        If the surface has no triangles, faces that are not triangles, or points that are not finite.

    References
    ----------
    Baerentzen, Aanaes 2005, *Signed distance computation using the angle weighted pseudonormal*,
    doi:10.1109/TVCG.2005.49; VTK's vtkImplicitPolyDataDistance.

    Examples
    --------
    >>> from vtkmodules.vtkFiltersSources import vtkSphereSource
    >>> from vtkmuscle.filters.surface_distance import SurfaceDistance
    >>> ball = vtkSphereSource(radius=10.0, theta_resolution=60, phi_resolution=60)
    >>> bone = SurfaceDistance(ball.update().output)
    >>> bone.unsigned([[0, 0, 13]]).round(6), bone.depth([[0, 0, 13], [0, 0, 9]]).round(1)
    (array([3.]), array([0., 1.]))
    """

    def __init__(self, surface: vtkPolyData) -> None:
        points, triangles = checked_surface(surface, "SurfaceDistance")
        self._points, self._triangles = _merged(points, triangles)

    def unsigned(self, points: ArrayLike) -> Floats:
        """Return the distance of each point (n, 3) from the nearest triangle, (n,)."""
        return np.abs(_evaluate(self._whole, _checked(points)))

    def signed(self, points: ArrayLike) -> Floats:
        """Return the distance of each point (n, 3) from the nearest triangle, negative behind it, (n,).

        Unlike :meth:`depth` it needs no closed shell, and tells nothing where shells overlap.
        """
        side = float(np.sign(signed_volume(self._points, self._triangles)) or 1.0)
        return side * _evaluate(self._whole, _checked(points))

    def closest(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Return the closest point on the surface to each point (n, 3), and its distance.

        Returns
        -------
        closest : (n, 3) array
            Points on triangles.
        distances : (n,) array
            As :meth:`unsigned`.
        """
        positions = _checked(points)
        closest, distances = np.empty_like(positions), np.empty(len(positions))
        found = [0.0, 0.0, 0.0]
        for i, position in enumerate(positions):
            distances[i] = self._whole.EvaluateFunctionAndGetClosestPoint(position, found)
            closest[i] = found
        return closest, np.abs(distances)

    def depth(self, points: ArrayLike) -> Floats:
        """Return how deep each point (n, 3) is inside the surface, (n,), 0 outside.

        That is the distance from the nearest triangle of the shell that the point is in, and of the
        shell in which it is deepest where shells overlap. A shell with a hole has no inside: its depth is
        0, with a warning.
        """
        positions = _checked(points)
        result = np.zeros(len(positions))
        for shell in self._shells:
            in_reach = np.flatnonzero(shell.sieve.contains(positions))
            depths = -_evaluate(shell.signed, positions[in_reach]) * shell.orientation
            result[in_reach] = np.maximum(result[in_reach], depths)
        return result

    def into(self, points: ArrayLike) -> Floats:
        """Return points (n, 3) with those outside moved to the closest place on the surface."""
        moved = _checked(points).copy()
        outside = np.flatnonzero(self.depth(moved) == 0.0)
        if len(outside):
            moved[outside] = self.closest(moved[outside])[0]
        return moved

    @cached_property
    def _whole(self) -> vtkImplicitPolyDataDistance:
        return _distance_function(self._points, self._triangles)

    @cached_property
    def _shells(self) -> list[_Shell]:
        edges = half_edges(self._triangles)
        labels = point_components(len(self._points), edges)[self._triangles[:, 0]]
        shells = []
        numbers = np.unique(labels)
        for number in numbers:
            triangles = self._triangles[labels == number]
            volume = signed_volume(self._points, triangles)
            if volume != 0.0 and _is_closed(triangles, len(self._points)):
                shells.append(
                    _Shell(
                        self._whole if len(numbers) == 1 else _distance_function(self._points, triangles),
                        float(np.sign(volume)),
                        build_voxel_grid(self._points, triangles, n_max=_SIEVE_CELLS),
                    )
                )
        if len(shells) < len(numbers):
            warnings.warn(
                f"SurfaceDistance: {len(numbers) - len(shells)} of {len(numbers)} shell(s) of the surface "
                "have holes or no volume, and so no inside: points in them have depth 0",
                stacklevel=3,
            )
        return shells


@dataclass(frozen=True)
class _Shell:
    """A closed shell: its signed distance (negative inside, for orientation 1) and its voxels.

    The voxels that are not outside hold all of the inside: a point elsewhere need not be measured.
    """

    signed: vtkImplicitPolyDataDistance
    orientation: float
    sieve: VoxelGrid


def _merged(points: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Return the mesh with equal points made one and without triangles of fewer than three points.

    Surfaces that give each triangle points of its own would otherwise be open everywhere.
    """
    used, of_corner = np.unique(triangles, return_inverse=True)
    distinct, of_used = np.unique(points[used], axis=0, return_inverse=True)
    merged = of_used.reshape(-1)[of_corner.reshape(-1)].reshape(-1, 3)
    whole = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
    return distinct, merged[whole].astype(np.int64)


def _is_closed(triangles: Ints, n_points: int) -> bool:
    edges = half_edges(triangles)
    uses = np.unique(edges.min(axis=1) * n_points + edges.max(axis=1), return_counts=True)[1]
    return bool((uses > 1).all())


def _distance_function(points: Floats, triangles: Ints) -> vtkImplicitPolyDataDistance:
    used, renumbered = np.unique(triangles, return_inverse=True)
    function = vtkImplicitPolyDataDistance()
    function.SetInput(surface_from(points[used], renumbered.reshape(-1, 3)))
    return function


def _checked(points: ArrayLike) -> Floats:
    positions = np.ascontiguousarray(points, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3 or not np.isfinite(positions).all():
        raise ValueError("SurfaceDistance: points must be an (n, 3) array of finite numbers")
    return positions


def _evaluate(function: vtkImplicitPolyDataDistance, points: Floats) -> Floats:
    if not len(points):
        return np.zeros(0)
    distances = vtkDoubleArray()
    function.FunctionValue(numpy_to_vtk(points), distances)
    values: Floats = np.array(vtk_to_numpy(distances), dtype=np.float64).reshape(-1)
    return values
