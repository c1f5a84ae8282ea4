"""Properties of a muscle's surface, computed once for all filters."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.attachments.patches import attachment_patch
from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.mesh.sampling import samples_inside
from vtkmuscle.core.mesh.shared import shared
from vtkmuscle.core.mesh.solids import Solids, solids_of
from vtkmuscle.core.mesh.surface import (
    edge_lengths,
    edge_uses,
    faces_between,
    half_edges,
    opposite_half_edges,
)
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.morphing.sections import ClosedSurface
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import blocks_of, checked_surface, point_array
from vtkmuscle.data.attachments import AttachmentArea

T = TypeVar("T")

#: Number of cached surfaces: the muscles of a limb; 20 000 triangles take about 10 MB.
REMEMBERED = 8


class SurfaceTopology:
    """Properties of triangles (m, 3) that do not depend on positions."""

    def __init__(self, triangles: Ints) -> None:
        self.triangles = triangles

    @cached_property
    def n_open_edges(self) -> int:
        """Number of edges in a single triangle."""
        return int((edge_uses(self.triangles) == 1).sum())

    @cached_property
    def opposite(self) -> Ints:
        """Opposite of each half-edge; ValueError for an open surface."""
        return opposite_half_edges(self.triangles)


class MuscleGeometry:
    """A surface with properties computed on demand."""

    def __init__(self, points: Floats, triangles: Ints) -> None:
        self.points = points
        self._topology = _topology(triangles)
        self.triangles = self._topology.triangles
        self._facts: dict[Hashable, Any] = {}
        self._samples = np.empty((0, 3))

    @property
    def n_open_edges(self) -> int:
        """Number of edges in a single triangle."""
        return self._topology.n_open_edges

    @property
    def closed(self) -> ClosedSurface:
        """The surface for cutting; ValueError if open or inconsistently oriented."""
        return ClosedSurface(self.points, self.triangles, self._topology.opposite)

    @cached_property
    def mean_edge(self) -> float:
        """Mean edge length [mm]; edges of two triangles count twice."""
        return float(edge_lengths(self.points, half_edges(self.triangles)).mean())

    @cached_property
    def solids(self) -> Solids:
        """Inside of the surface, and distances to the surface."""
        return solids_of(self.points, self.triangles)

    def patch(self, area: AttachmentArea) -> Ints:
        """Return the point ids of an attachment area; ValueError off the surface."""
        landmarks, closed = area.landmarks, area.closed
        key = "patch", np.ascontiguousarray(landmarks).tobytes(), closed
        return self.once(key, lambda: attachment_patch(self.points, self.triangles, landmarks, closed))

    def attached(self, areas: Sequence[AttachmentArea], role: str) -> Ints:
        """Return the point ids of all areas of a role, ascending.

        ValueError if the role has no area, or an area off the surface.
        """
        patches = []
        for number, area in enumerate(area for area in areas if area.role == role):
            with errors_at(f"attachments: {role} area {number}"):
                patches.append(self.patch(area))
        if not patches:
            raise InputError("attachments", f"there is no area with the role {role!r}")
        return np.unique(np.concatenate(patches))

    def once(self, key: Hashable, compute: Callable[[], T]) -> T:
        """Return a function's result, computed once per key."""
        if key not in self._facts:
            self._facts[key] = compute()
        fact: T = self._facts[key]
        return fact

    def patch_tree(self, patch: Ints) -> TriangleTree | None:
        """Return the hierarchy of triangles between points (j,), None without triangles."""

        def tree() -> TriangleTree | None:
            faces = faces_between(self.triangles, patch)
            return triangle_tree(self.points, faces) if len(faces) else None

        return self.once(("tree", patch.tobytes()), tree)

    def samples(self, count: int) -> Floats:
        """Return `count` inner positions [mm], evenly spread; fewer for flat surfaces."""
        if len(self._samples) < count:
            # A power of two, to serve other numbers of fibres.
            self._samples = samples_inside(self.solids.inside, self.points, 2 ** (count - 1).bit_length())
        return self._samples[:count]


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface as a filter's argument."""

    data: vtkPolyData
    points: Floats
    triangles: Ints
    where: str

    @cached_property
    def geometry(self) -> MuscleGeometry:
        """Properties of the surface: :func:`muscle_geometry`."""
        return _geometry(self.points, self.triangles)

    def closed(self, why: str) -> MuscleGeometry:
        """Return the properties; InputError with a reason for an open surface."""
        if self.geometry.n_open_edges:
            problem = f"the surface has {self.geometry.n_open_edges} open edge(s), {why}"
            remedy = "close its holes, and merge equal points (vtkCleanPolyData)"
            raise InputError(self.where, problem, remedy)
        return self.geometry

    def array(self, name: str) -> NDArray[Any]:
        """Return a point array as a read-only view; InputError if missing."""
        return point_array(self.data, name, self.where)


def surface_of(data: vtkPolyData, where: str) -> Surface:
    """Return a surface as a filter's argument; raises as :func:`muscle_geometry`."""
    return Surface(data, *checked_surface(data, where), where)


def surfaces_of(data: vtkMultiBlockDataSet, where: str) -> list[Surface]:
    """Return the surfaces of all blocks; raises as :func:`muscle_geometry`."""
    return [surface_of(block, f"{where}, block {name!r}") for name, block in blocks_of(data)]


def muscle_geometry(surface: vtkPolyData, where: str) -> MuscleGeometry:
    """Return a surface's properties, the same object for the same content.

    Content decides, not modification times: copies of a muscle share properties, and a change through a numpy
    view counts. ValueError at `where` without triangles, with other faces, or for a point that is not finite.
    """
    return _geometry(*checked_surface(surface, where))


_topology = shared(SurfaceTopology, last=REMEMBERED)
_geometry = shared(MuscleGeometry, last=REMEMBERED)
