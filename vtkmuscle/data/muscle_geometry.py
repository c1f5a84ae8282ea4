"""Facts about a muscle's surface that several filters need, computed once for all of them."""

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

#: Surfaces that are remembered: the muscles of a limb. One of 20 000 triangles takes about 10 MB.
REMEMBERED = 8


class SurfaceTopology:
    """Facts about triangles (m, 3) that do not depend on where their points are."""

    def __init__(self, triangles: Ints) -> None:
        self.triangles = triangles

    @cached_property
    def n_open_edges(self) -> int:
        """Number of edges that only one triangle has."""
        return int((edge_uses(self.triangles) == 1).sum())

    @cached_property
    def opposite(self) -> Ints:
        """The opposite of each half-edge; ValueError where the surface is open."""
        return opposite_half_edges(self.triangles)


class MuscleGeometry:
    """A surface, points (n, 3) [mm] and triangles (m, 3), with facts that are computed when first needed."""

    def __init__(self, points: Floats, triangles: Ints) -> None:
        self.points = points
        self._topology = _topology(triangles)
        self.triangles = self._topology.triangles
        self._facts: dict[Hashable, Any] = {}
        self._samples = np.empty((0, 3))

    @property
    def n_open_edges(self) -> int:
        """Number of edges that only one triangle has."""
        return self._topology.n_open_edges

    @property
    def closed(self) -> ClosedSurface:
        """The surface for cutting; ValueError where it is open or its triangles face different sides."""
        return ClosedSurface(self.points, self.triangles, self._topology.opposite)

    @cached_property
    def mean_edge(self) -> float:
        """Mean length of an edge [mm]; in a closed mesh all edges are in two triangles, and count twice."""
        return float(edge_lengths(self.points, half_edges(self.triangles)).mean())

    @cached_property
    def solids(self) -> Solids:
        """The inside of the surface, and distances from it."""
        return solids_of(self.points, self.triangles)

    def patch(self, area: AttachmentArea) -> Ints:
        """Return the ids of the points that an attachment area covers; ValueError for one off the surface."""
        given = area.landmarks, area.closed
        key = "patch", np.ascontiguousarray(area.landmarks).tobytes(), area.closed
        return self.once(key, lambda: attachment_patch(self.points, self.triangles, *given))

    def attached(self, areas: Sequence[AttachmentArea], role: str) -> Ints:
        """Return the ids of the points that all areas of a role cover together, ascending.

        Raises a ValueError if there is no such area, or one is off the surface.
        """
        patches = []
        for number, area in enumerate(area for area in areas if area.role == role):
            with errors_at(f"attachments: {role} area {number}"):
                patches.append(self.patch(area))
        if not patches:
            raise InputError("attachments", f"there is no area with the role {role!r}")
        return np.unique(np.concatenate(patches))

    def once(self, key: Hashable, find: Callable[[], T]) -> T:
        """Return the result of a function, which is called once for each key."""
        if key not in self._facts:
            self._facts[key] = find()
        fact: T = self._facts[key]
        return fact

    def patch_tree(self, patch: Ints) -> TriangleTree | None:
        """Return the tree of the triangles between points (j,) of the surface, None if there are none."""

        def tree() -> TriangleTree | None:
            faces = faces_between(self.triangles, patch)
            return triangle_tree(self.points, faces) if len(faces) else None

        return self.once(("tree", patch.tobytes()), tree)

    def samples(self, count: int) -> Floats:
        """Return `count` positions [mm] of even density in it, fewer where it has next to no volume."""
        if len(self._samples) < count:
            # Up to a power of two, which will do for other numbers of fibres as well.
            self._samples = samples_inside(self.solids.inside, self.points, 2 ** (count - 1).bit_length())
        return self._samples[:count]


@dataclass(frozen=True, eq=False)
class Surface:
    """A filter's argument for a surface: its data, finite points (n, 3) [mm], triangles; place in errors."""

    data: vtkPolyData
    points: Floats
    triangles: Ints
    where: str

    @cached_property
    def geometry(self) -> MuscleGeometry:
        """Facts about the surface: :func:`muscle_geometry`."""
        return _geometry(self.points, self.triangles)

    def closed(self, why: str) -> MuscleGeometry:
        """Return the facts about the surface; InputError with a reason where it is open."""
        if self.geometry.n_open_edges:
            raise InputError(
                self.where,
                f"the surface has {self.geometry.n_open_edges} open edge(s), {why}",
                "close its holes, and merge equal points (vtkCleanPolyData)",
            )
        return self.geometry

    def array(self, name: str) -> NDArray[Any]:
        """Return a point array as a read-only view; InputError where there is none."""
        return point_array(self.data, name, self.where)


def surface_of(data: vtkPolyData, where: str) -> Surface:
    """Return the argument of a filter for a surface; raises as :func:`muscle_geometry` does."""
    return Surface(data, *checked_surface(data, where), where)


def surfaces_of(data: vtkMultiBlockDataSet, where: str) -> list[Surface]:
    """Return the surfaces of a data set's blocks; raises as :func:`muscle_geometry` does."""
    return [surface_of(block, f"{where}, block {name!r}") for name, block in blocks_of(data)]


def muscle_geometry(surface: vtkPolyData, where: str) -> MuscleGeometry:
    """Return the facts about a surface, the same object for the same points and triangles.

    Content decides, not modification times, so that copies of a muscle share facts, and a surface that was
    changed through a numpy view is another one. Raises a ValueError at `where` if the surface has no
    triangles or other faces, or a point is not finite.
    """
    return _geometry(*checked_surface(surface, where))


_topology = shared(SurfaceTopology, last=REMEMBERED)
_geometry = shared(MuscleGeometry, last=REMEMBERED)
