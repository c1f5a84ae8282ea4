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
from vtkmuscle.core.mesh.sampling import PatchSamples, samples_inside
from vtkmuscle.core.mesh.shared import shared
from vtkmuscle.core.mesh.solids import Solids, solids_of
from vtkmuscle.core.mesh.surface import (
    edge_lengths,
    edge_uses,
    half_edges,
    opposite_half_edges,
    signed_volume,
)
from vtkmuscle.core.mesh.triangle_tree import Neighbour, TriangleTree, triangle_tree
from vtkmuscle.core.morphing.sections import ClosedSurface
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import blocks_of, checked_surface, point_array
from vtkmuscle.data.attachments import AttachmentArea, areas_of_role

T = TypeVar("T")

#: Number of cached surfaces: the muscles of a limb; 20 000 triangles take about 10 MB.
REMEMBERED = 8


class MuscleGeometry:
    """A surface with properties computed on demand."""

    def __init__(self, points: Floats, triangles: Ints) -> None:
        self.points, self.triangles = points, triangles
        self._known: dict[Hashable, Any] = {}
        self._samples = np.empty((0, 3))

    @cached_property
    def n_open_edges(self) -> int:
        """Number of edges in a single triangle."""
        return int((edge_uses(self.triangles) == 1).sum())

    @cached_property
    def closed(self) -> ClosedSurface:
        """The surface for cutting; ValueError if open or inconsistently oriented."""
        return ClosedSurface(self.points, self.triangles, opposite_half_edges(self.triangles))

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
        surface, ring = (self.points, self.triangles), (area.landmarks, area.closed)
        return self.once("patch", ring, lambda: attachment_patch(*surface, *ring))

    def attached(self, areas: Sequence[AttachmentArea], role: str) -> Ints:
        """Return the point ids of all areas of a role, ascending.

        ValueError if the role has no area, or an area off the surface.
        """
        patches = []
        for number, area in enumerate(areas_of_role(areas, role)):
            with errors_at(f"attachments: {role} area {number}"):
                patches.append(self.patch(area))
        return np.unique(np.concatenate(patches))

    def on(self, patch: Ints) -> PatchSamples:
        """Return the surface between points (j,)."""
        return self.once("on", (patch,), lambda: PatchSamples(self.points, self.triangles, patch))

    def once(self, what: str, given: Sequence[Any], compute: Callable[[], T]) -> T:
        """Return a result of the surface and of what is given, computed once; arrays count by content."""
        key = what, *(part.tobytes() if isinstance(part, np.ndarray) else part for part in given)
        if key not in self._known:
            self._known[key] = compute()
        result: T = self._known[key]
        return result

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


def muscle_geometry(surface: vtkPolyData, where: str) -> MuscleGeometry:
    """Return a surface's properties, the same object for the same content.

    Content decides, not modification times: copies of a muscle share properties, and a change through a numpy
    view counts. ValueError at `where` without triangles, with other faces, or for a point that is not finite.
    """
    return _geometry(*checked_surface(surface, where))


_geometry = shared(MuscleGeometry, last=REMEMBERED)


class Neighbours:
    """The neighbours of a muscle over time; the muscle is at rest (n, 3), of several levels or one."""

    def __init__(self, *rests: Floats) -> None:
        self._rests = rests
        self._allowances: dict[int, list[Floats]] = {}

    def at(self, muscles: vtkMultiBlockDataSet | None) -> list[Any]:
        """Return a Neighbour for each muscle in a pose, a tuple of them for several levels.

        Muscles are surfaces of triangles with the point array ``Displacement``.
        """
        neighbours: list[Any] = []
        for number, (name, block) in enumerate([] if muscles is None else blocks_of(muscles)):
            where = f"neighbours, block {name!r}"
            if not isinstance(block, vtkPolyData):
                raise InputError(where, "it is no vtkPolyData", "connect outputs of PBDDeformer")
            points, triangles = checked_surface(block, where)
            if number not in self._allowances:
                displacement = np.array(point_array(block, "Displacement", where))
                at_rest = outward_tree(points - displacement, triangles)
                self._allowances[number] = [at_rest.depth(rest) for rest in self._rests]
            tree = outward_tree(points, triangles)
            levels = tuple(Neighbour(tree, allowance) for allowance in self._allowances[number])
            neighbours.append(levels if len(levels) > 1 else levels[0])
        return neighbours


def outward_tree(points: Floats, triangles: NDArray[np.int64]) -> TriangleTree:
    """Return the hierarchy of a closed surface with outward triangles."""
    if signed_volume(points, triangles) < 0.0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    return triangle_tree(points, triangles)
