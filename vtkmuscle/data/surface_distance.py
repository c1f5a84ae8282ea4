"""Exact distances from a triangle surface, and how deep points are inside it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.collision.voxels import VoxelGrid, build_voxel_grid
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.closed_shells import welded
from vtkmuscle.core.mesh.shared import shared
from vtkmuscle.core.mesh.surface import edge_uses, half_edges, point_components, signed_volume
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, shared_tree
from vtkmuscle.core.types import Bools, Floats, Ints
from vtkmuscle.data.arrays import checked_surface

#: Cells of the grid that sorts out points which cannot be inside.
_SIEVE_CELLS = 64**3


class SurfaceDistance:
    """Distances of points from the triangles of a surface (not from a grid or a sampling of them).

    Each connected shell has an inside of its own, whether its triangles face outward or inward: where
    shells overlap, as the bones of a pelvis do, and for a hollow in a bone, which counts as filled. The
    sign is that of the angle-weighted normal at the closest point, exact for closed manifold shells of any
    genus. What that takes is built when it is first needed: a surface that no point comes near costs nothing.

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
    doi:10.1109/TVCG.2005.49.

    Examples
    --------
    >>> from vtkmodules.vtkFiltersSources import vtkSphereSource
    >>> from vtkmuscle.data.surface_distance import SurfaceDistance
    >>> ball = vtkSphereSource(radius=10.0, theta_resolution=60, phi_resolution=60)
    >>> bone = SurfaceDistance(ball.update().output)
    >>> bone.unsigned([[0, 0, 13]]).round(6), bone.depth([[0, 0, 13], [0, 0, 9]]).round(1)
    (array([3.]), array([0., 1.]))
    """

    def __init__(self, surface: vtkPolyData) -> None:
        self._parts = _parts_of(*checked_surface(surface, "SurfaceDistance"))
        #: Whether no edge is that of one triangle alone.
        self.closed = self._parts.closed
        #: Lowest and highest corner of the surface's box.
        self.box: tuple[Floats, Floats] = self._parts.box

    def unsigned(self, points: ArrayLike) -> Floats:
        """Return the distance of each point (n, 3) from the nearest triangle, (n,)."""
        return self._parts.whole.nearest(_checked(points))[2]

    def signed(self, points: ArrayLike) -> Floats:
        """Return the distance of each point (n, 3) from the nearest triangle, negative behind it, (n,).

        Unlike :meth:`depth` it needs no closed shell, and means nothing where shells overlap.
        """
        return self._parts.side * self._parts.whole.signed(_checked(points))[0]

    def closest(self, points: ArrayLike) -> tuple[Floats, Floats]:
        """Return the closest point on the surface to each point (n, 3), and its distance.

        Returns
        -------
        closest : (n, 3) array
            Points on triangles.
        distances : (n,) array
            As :meth:`unsigned`.
        """
        _, closest, distances = self._parts.whole.nearest(_checked(points))
        return closest, distances

    def depth(self, points: ArrayLike) -> Floats:
        """Return how deep each point (n, 3) is inside the surface, (n,), 0 outside.

        That is the distance from the nearest triangle of the shell that the point is in, and of the
        shell in which it is deepest where shells overlap. A shell with a hole has no inside: its depth is
        0, with a warning.
        """
        positions = _checked(points)
        result = np.zeros(len(positions))
        low, high = self.box
        if not ((positions >= low) & (positions <= high)).all(axis=1).any():
            return result  # without building anything: most bones of a scene are far from most muscles
        with self._parts.building:
            sieves = [(shell, shell.sieve) for shell in self._parts.shells]
        for shell, sieve in sieves:
            in_reach = np.flatnonzero(sieve.contains(positions))
            depths = -shell.tree.signed(positions[in_reach])[0]
            result[in_reach] = np.maximum(result[in_reach], depths)
        return result

    def inside(self, points: ArrayLike) -> Bools:
        """Return whether each point (n, 3) is inside the surface, where its depth is more than 0, (n,)."""
        positions = _checked(points)
        result = np.zeros(len(positions), dtype=np.bool_)
        for shell in self._parts.shells:
            result |= shell.sieve.encloses(positions)
            open_ = np.flatnonzero(~result & shell.sieve.contains(positions))
            result[open_] = shell.tree.signed(positions[open_])[0] < 0.0
        return result

    def into(self, points: ArrayLike) -> Floats:
        """Return points (n, 3) with those outside moved to the closest place on the surface."""
        moved = _checked(points).copy()
        outside, closest = np.arange(len(moved)), moved
        for shell in self._parts.shells:
            outside = outside[~shell.sieve.encloses(moved[outside])]
            distances, closest = shell.tree.signed(moved[outside])
            outside, closest = outside[distances >= 0.0], closest[distances >= 0.0]
        if len(self._parts.shells) != 1:
            closest = self._parts.whole.nearest(moved[outside])[1]
        moved[outside] = closest
        return moved


class _Parts:
    """What is asked of a surface, each made when it is first needed.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions; point ids.
    """

    def __init__(self, points: Floats, triangles: Ints) -> None:
        self.closed = _is_closed(triangles)
        if not self.closed:
            points, triangles = welded(points, triangles)
            self.closed = _is_closed(triangles)
        self._points, self._triangles = points, triangles
        self.box: tuple[Floats, Floats] = points.min(axis=0), points.max(axis=0)
        self.building = Lock()

    @cached_property
    def side(self) -> float:
        """1 where the triangles face outward, -1 where they face inward."""
        return float(np.sign(signed_volume(self._points, self._triangles)) or 1.0)

    @cached_property
    def whole(self) -> TriangleTree:
        """All triangles."""
        return shared_tree(self._points, self._triangles)

    @cached_property
    def shells(self) -> list[_Shell]:
        """The closed parts, facing outward."""
        edges = half_edges(self._triangles)
        labels = point_components(len(self._points), edges)[self._triangles[:, 0]]
        shells = []
        numbers = np.unique(labels)
        for number in numbers:
            triangles = self._triangles[labels == number]
            volume = signed_volume(self._points, triangles)
            if volume != 0.0 and _is_closed(triangles):
                outward = triangles if volume > 0.0 else triangles[:, ::-1]
                shells.append(_Shell(shared_tree(self._points, outward)))
        if len(shells) < len(numbers):
            warnings.warn(
                f"SurfaceDistance: {len(numbers) - len(shells)} of {len(numbers)} shell(s) of the surface "
                "have holes or no volume, and so no inside: points in them have depth 0",
                stacklevel=3,
            )
        return shells


_parts_of = shared(_Parts)


@dataclass(frozen=True, eq=False)
class _Shell:
    """A closed shell that faces outward."""

    tree: TriangleTree

    @cached_property
    def sieve(self) -> VoxelGrid:
        """Voxels: points in those that are outside, or all inside, need not be measured."""
        return build_voxel_grid(self.tree.points, self.tree.triangles, n_max=_SIEVE_CELLS)


def _is_closed(triangles: Ints) -> bool:
    return not (edge_uses(triangles) == 1).any()


def _checked(points: ArrayLike) -> Floats:
    positions = np.ascontiguousarray(points, dtype=np.float64)
    if positions.ndim != 2 or positions.shape[1] != 3 or not np.isfinite(positions).all():
        raise InputError("SurfaceDistance", "points must be an (n, 3) array of finite numbers")
    return positions
