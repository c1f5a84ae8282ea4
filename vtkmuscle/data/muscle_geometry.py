"""What several filters ask of one muscle surface, computed once for all of them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from functools import cached_property
from threading import Lock
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.attachments.patches import attachment_patch
from vtkmuscle.core.errors import InputError, placed
from vtkmuscle.core.mesh.sampling import samples_inside
from vtkmuscle.core.mesh.solids import Solids, solids_of
from vtkmuscle.core.mesh.surface import edge_uses, half_edges
from vtkmuscle.core.mesh.topology import opposite_half_edges
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.morphing.sections import ClosedSurface
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.data.attachments import AttachmentArea

T = TypeVar("T")

#: Surfaces that are remembered: the muscles of a limb. One of 20 000 triangles takes about 10 MB.
REMEMBERED = 8

#: Arrays, and what is known where they are equal to these; what was asked for last comes last.
_known: list[tuple[tuple[NDArray[Any], ...], MuscleGeometry]] = []
_topologies: list[tuple[tuple[NDArray[Any], ...], SurfaceTopology]] = []
_lock = Lock()


class SurfaceTopology:
    """What of a surface stays the same wherever its points are.

    Parameters
    ----------
    triangles : (m, 3) int array
        Point ids.
    """

    def __init__(self, triangles: Ints) -> None:
        self.triangles = triangles

    @cached_property
    def n_open_edges(self) -> int:
        """Number of edges that only one triangle has."""
        return int((edge_uses(self.triangles) == 1).sum())

    @cached_property
    def opposite(self) -> Ints:
        """Of each half-edge the opposite one; ValueError where the surface is open."""
        return opposite_half_edges(self.triangles)


class MuscleGeometry:
    """A surface and what was found out about it so far: each fact is computed when first asked for.

    Parameters
    ----------
    points : (n, 3) array
        Its points [mm].
    topology : SurfaceTopology
        Of its triangles.
    """

    def __init__(self, points: Floats, topology: SurfaceTopology) -> None:
        self.points, self.triangles = points, topology.triangles
        self._topology = topology
        self._found: dict[Hashable, Any] = {}
        self._samples = np.empty((0, 3))

    @property
    def n_open_edges(self) -> int:
        """Number of edges that only one triangle has."""
        return self._topology.n_open_edges

    @property
    def closed(self) -> ClosedSurface:
        """The surface to cut; ValueError where it is open or its triangles face different sides."""
        return ClosedSurface(self.points, self.triangles, self._topology.opposite)

    @cached_property
    def mean_edge(self) -> float:
        """Mean length of an edge [mm]; in a closed mesh all edges are in two triangles, and count twice."""
        edges = half_edges(self.triangles)
        return float(np.linalg.norm(self.points[edges[:, 1]] - self.points[edges[:, 0]], axis=1).mean())

    @cached_property
    def solids(self) -> Solids:
        """What is inside of the surface, and how far things are from it."""
        return solids_of(self.points, self.triangles)

    def patch(self, area: AttachmentArea) -> Ints:
        """Return the ids of the points that an attachment area covers; ValueError where it is off it."""
        key = "patch", np.ascontiguousarray(area.landmarks).tobytes(), area.closed
        return self.once(
            key, lambda: attachment_patch(self.points, self.triangles, area.landmarks, area.closed)
        )

    def attached(self, areas: Sequence[AttachmentArea], role: str, where: str) -> Ints:
        """Return the ids of the points that all areas of a role cover together, ascending.

        Raises
        ------
        ValueError
            If there is no such area, or the landmarks of one cannot be on this muscle.
        """
        patches = []
        for number, area in enumerate(area for area in areas if area.role == role):
            with placed(f"{where}: {role} area {number}"):
                patches.append(self.patch(area))
        if not patches:
            raise InputError(where, f"there is no area with the role {role!r}")
        return np.unique(np.concatenate(patches))

    def once(self, key: Hashable, find: Callable[[], T]) -> T:
        """Return what a function finds out about the surface; it is asked once for each key."""
        if key not in self._found:
            self._found[key] = find()
        found: T = self._found[key]
        return found

    def patch_tree(self, patch: Ints) -> TriangleTree | None:
        """Return the triangles between points (j,) of the surface, None if there are none."""

        def tree() -> TriangleTree | None:
            member = np.zeros(len(self.points), dtype=np.bool_)
            member[patch] = True
            faces = self.triangles[member[self.triangles].all(axis=1)]
            return triangle_tree(self.points, faces) if len(faces) else None

        return self.once(("tree", patch.tobytes()), tree)

    def samples(self, count: int) -> Floats:
        """Return positions (k, 3) of even density in it, `count` but where it has next to no volume [mm]."""
        if len(self._samples) < count:
            # Up to a power of two: another number of fibres then needs none of its own.
            self._samples = samples_inside(self.solids.inside, self.points, 2 ** (count - 1).bit_length())
        return self._samples[:count]


def muscle_geometry(surface: vtkPolyData, where: str) -> MuscleGeometry:
    """Return what is known of a surface, the same object for the same points and triangles.

    Content decides, not modification times, so that copies of a muscle share what is known, and a surface
    that was changed through a numpy view is another one.

    Parameters
    ----------
    surface : vtkPolyData
        Triangles.
    where : str
        Named in errors, e.g. ``"FibreTrimmer: muscle"``.

    Raises
    ------
    ValueError
        If the surface has no triangles or other faces, or a point is not finite.
    """
    positions, faces = _arrays(surface)
    with _lock:
        found = _recalled(_known, (*positions, *faces))
        if found is None:
            points, triangles = checked_surface(surface, where)
            size = np.array(len(points))
            topology = _recalled(_topologies, (size, *faces))
            if topology is None:
                topology = SurfaceTopology(triangles)
                _remember(_topologies, (size, *faces), topology)
            found = MuscleGeometry(points, topology)
            _remember(_known, (*positions, *faces), found)
    return found


def _arrays(surface: vtkPolyData) -> tuple[tuple[NDArray[Any], ...], tuple[NDArray[Any], ...]]:
    """Return the arrays of a surface's points and of its faces, whatever these are."""
    polys, points = surface.GetPolys(), surface.GetPoints()
    if points is None or polys.GetNumberOfCells() == 0:
        return (), ()
    # Whatever the arrays' types: copies may have others.
    positions = np.asarray(vtk_to_numpy(points.GetData()), dtype=np.float64)
    arrays = vtk_to_numpy(polys.GetOffsetsArray()), vtk_to_numpy(polys.GetConnectivityArray())
    faces = tuple(np.asarray(array, dtype=np.int64) for array in arrays)
    return (positions,), (np.array(surface.GetNumberOfStrips()), *faces)


def _recalled(known: list[tuple[tuple[NDArray[Any], ...], T]], arrays: tuple[NDArray[Any], ...]) -> T | None:
    """Return what is remembered of equal arrays, None where nothing is."""
    for number, (theirs, found) in enumerate(known):
        if len(theirs) == len(arrays) and all(map(np.array_equal, theirs, arrays)):
            known.append(known.pop(number))
            return found
    return None


def _remember(
    known: list[tuple[tuple[NDArray[Any], ...], T]], arrays: tuple[NDArray[Any], ...], found: T
) -> None:
    """Put something at the end of what is remembered, and forget what is too much."""
    known.append((tuple(array.copy() for array in arrays), found))  # the caller's may change
    del known[:-REMEMBERED]
