"""Properties of a muscle's surface, computed once for all filters; areas and aponeuroses as end surfaces."""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.attachments.patches import Patch, attachment_patch, band_along, discs_over
from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.fibres.between_areas import EndSurface
from vtkmuscle.core.mesh import surface as surfaces
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.sampling import PatchSamples, samples_inside
from vtkmuscle.core.mesh.shared import shared
from vtkmuscle.core.mesh.solids import Solids, open_edges, solids_of
from vtkmuscle.core.mesh.surface import extent
from vtkmuscle.core.mesh.triangle_tree import Neighbour, TriangleTree, triangle_tree
from vtkmuscle.core.morphing.sections import ClosedSurface
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import blocks_of, checked_surface, point_array
from vtkmuscle.data.attachments import ROLES, SIDES, Aponeurosis, AttachmentArea, areas_of_role

T = TypeVar("T")
#: An area on a muscle's surface, or a separate surface.
Shape = AttachmentArea | tuple[Floats, Ints]

#: Number of cached surfaces: the muscles of a limb; 20 000 triangles take about 10 MB.
REMEMBERED = 8
#: Number of cached results of a surface: a muscle of two areas has ten.
RESULTS = 64


class MuscleGeometry:
    """A surface with properties computed on demand."""

    def __init__(self, points: Floats, triangles: Ints) -> None:
        self.points, self.triangles = points, triangles
        self._known: dict[Hashable, tuple[Any]] = {}
        self._samples = np.empty((0, 3))

    @cached_property
    def n_open_edges(self) -> int:
        """Number of triangles' edges without a counterpart that runs back in another triangle."""
        return len(open_edges(self.triangles))

    @cached_property
    def closed(self) -> ClosedSurface:
        """The surface for cutting; ValueError if open or inconsistently oriented."""
        return ClosedSurface(self.points, self.triangles, surfaces.opposite_half_edges(self.triangles))

    @cached_property
    def mean_edge(self) -> float:
        """Mean edge length [mm]; edges of two triangles count twice."""
        return float(surfaces.edge_lengths(self.points, surfaces.half_edges(self.triangles)).mean())

    @cached_property
    def solids(self) -> Solids:
        """Inside of the surface, and distances to the surface."""
        return solids_of(self.points, self.triangles)

    def patch(self, area: AttachmentArea) -> Patch:
        """Return an attachment area; ValueError off the surface."""
        surface, ring = (self.points, self.triangles), (area.landmarks, area.closed)
        return self.once("patch", ring, lambda: attachment_patch(*surface, *ring))

    def attached(self, areas: Sequence[AttachmentArea], role: str) -> Ints:
        """Return the point ids of all areas of a role, ascending."""
        return np.unique(np.concatenate([patch.points for patch in self._patches(areas, role)]))

    def covered(self, areas: Sequence[AttachmentArea], role: str) -> PatchSamples:
        """Return the surface of all areas of a role."""
        return self.on(self._patches(areas, role))

    def on(self, patches: Sequence[Patch]) -> PatchSamples:
        """Return the surface of attachment areas."""
        key = [part for patch in patches for part in patch]
        return self.once("on", key, lambda: samples_of(self.points, self.triangles, patches))

    def _patches(self, areas: Sequence[AttachmentArea], role: str) -> list[Patch]:
        patches = []
        for number, area in enumerate(areas_of_role(areas, role)):
            with errors_at(f"attachments: {role} area {number}"):
                patches.append(self.patch(area))
        return patches

    def once(self, what: str, inputs: Sequence[Any], compute: Callable[[], T]) -> T:
        """Return a result, computed once for inputs of equal content. Results used last are kept."""
        key = what, *(part.tobytes() if isinstance(part, np.ndarray) else part for part in inputs)
        self._known[key] = kept = self._known.pop(key, None) or (compute(),)
        for oldest in list(self._known)[:-RESULTS]:
            self._known.pop(oldest, None)
        result: T = kept[0]
        return result

    def samples(self, count: int) -> Floats:
        """Return `count` inner positions [mm], evenly spread; fewer for flat surfaces."""
        if len(self._samples) < count:
            # A power of two, to serve other numbers of fibres.
            surface = surfaces.used_alone(self.points, self.triangles)[0]
            self._samples = samples_inside(self.solids.inside, surface, 2 ** (count - 1).bit_length())
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
        """Properties of the surface. The same content has the same object, also in a copy."""
        return _geometry(self.points, self.triangles)

    def closed(self, why: str) -> MuscleGeometry:
        """Return the properties; InputError with a reason for an open surface, or triangles not alike."""
        if count := self.geometry.n_open_edges:
            problem = f"the surface has {count} open edge(s), or between triangles of opposite sides, {why}"
            remedy = "close its holes, merge equal points (vtkCleanPolyData), orient it (vtkPolyDataNormals)"
            raise InputError(self.where, problem, remedy)
        return self.geometry

    def array(self, name: str) -> NDArray[Any]:
        """Return a point array as a read-only view; InputError if missing."""
        return point_array(self.data, name, self.where)


def surface_of(data: vtkPolyData, where: str) -> Surface:
    """Return a surface as a filter's argument. ValueError as of :func:`checked_surface`."""
    return Surface(data, *checked_surface(data, where), where)


def rest_surface_of(data: vtkPolyData, where: str) -> Surface:
    """Return a muscle at rest; raises as :func:`surface_of`, or for a muscle that has moved."""
    moved = data.GetPointData().GetArray("Displacement")
    if moved is not None and np.any(moved):
        raise InputError(where, "the muscle has moved", "connect it at rest, or remove its 'Displacement'")
    return surface_of(data, where)


_geometry = shared(MuscleGeometry, last=REMEMBERED)


class Neighbours:
    """The neighbours of a muscle over time. The muscle is at rest (n, 3), of several levels or one."""

    def __init__(self, *rests: Floats) -> None:
        self._rests = rests
        self._allowances: dict[int, list[Floats]] = {}

    def at(self, muscles: vtkMultiBlockDataSet | None) -> list[Any]:
        """Return a Neighbour (or several levels) for each muscle, with the point array ``Displacement``."""
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


def outward_tree(points: Floats, triangles: Ints) -> TriangleTree:
    """Return the hierarchy of a closed surface with outward triangles."""
    if surfaces.signed_volume(points, triangles) < 0.0:
        triangles = np.ascontiguousarray(triangles[:, ::-1])
    return triangle_tree(points, triangles)


#: Ratio of surface within a ring to the ring's disc above which the ring surrounds the muscle, and fibres end
#: on the disc: a hemisphere has 2.
BULGE = 2.0
#: Largest distance of an aponeurosis from its muscle, relative to the muscle's extent: finds wrong units.
FARTHEST = 0.05
#: Largest part of a muscle's surface that an aponeurosis may cover: the two sides of a sheet have half each.
COVERS = 0.6
#: Distance of positions on a surface, in mean edges: the mesh's own roughness. 0.1 and 0.5 move the points of
#: fibres in ten muscles of a hip and a knee by at most 1.2 mm (root mean square).
ROUGHNESS = 0.25
#: Sample positions on a surface: standard error of a share of 5 % is 1 %.
SAMPLES = 512


def aponeurosis_surfaces(
    aponeuroses: Sequence[Aponeurosis], geometry: MuscleGeometry, where: str,
    areas: Sequence[AttachmentArea] = (),
) -> tuple[EndSurface, EndSurface]:  # fmt: skip
    """Return the proximal and the distal aponeurosis of a muscle."""
    proximal, distal = (_of_side(aponeuroses, side, geometry, where) for side in SIDES)
    overlap = max(_share_in(proximal, distal, geometry), _share_in(distal, proximal, geometry))
    if overlap > surfaces.NOISE:  # rings may share a rim
        problem = f"the aponeuroses overlap: {100 * overlap:.0f} % of an area is in both"
        raise InputError(where, problem, "make an aponeurosis smaller; fibres run between both")
    landmarks = [[area.landmarks for area in areas if area.role == role] for role in ROLES]
    if all(landmarks):
        origin, insertion = (np.vstack(of_role).mean(axis=0) for of_role in landmarks)
        axis = insertion - origin
        low, high = (surface.samples.dense(SAMPLES).mean(axis=0) @ axis for surface in (proximal, distal))
        if low > high:
            problem = "the proximal aponeurosis is closer to the insertion than the distal aponeurosis"
            remedy = "exchange proximal and distal, or the roles origin and insertion of the attachments"
            raise InputError(where, problem, remedy)
    return proximal, distal


def _of_side(sheets: Sequence[Aponeurosis], side: str, geometry: MuscleGeometry, where: str) -> EndSurface:
    """Return the aponeuroses of a side as one surface."""
    shapes: list[Shape] = []
    label = f"{where}: {side}"
    for sheet in sheets:
        if sheet.side == side:
            _check_distance(sheet.points, geometry, label)
            ring = AttachmentArea("origin", "", sheet.points, closed=True)
            shapes.append((sheet.points, sheet.triangles) if len(sheet.triangles) else ring)
    if not shapes:
        raise InputError(where, f"there is no {side} aponeurosis", "give both, proximal and distal")
    surface = joined_surface(shapes, geometry, label, (1.0, 1.0))
    share = surface.samples.area / _area(geometry.points, geometry.triangles)
    if share > COVERS:
        problem = f"the aponeurosis covers {100 * share:.0f} % of the muscle's surface"
        raise InputError(label, problem, "draw the ring around the fibre ends only")
    return surface


def joined_surface(
    shapes: Sequence[Shape], geometry: MuscleGeometry, where: str, takes: tuple[float, float] = (0.0, np.inf)
) -> EndSurface:
    """Return areas and separate surfaces as one end surface. `takes` is a range on the muscle's surface."""
    patches: list[Patch] = []
    points, triangles, first = [geometry.points], [geometry.triangles], len(geometry.points)
    for number, shape in enumerate(shapes):
        with errors_at(f"{where} {number}"):
            inner = _within(shape, geometry) if isinstance(shape, AttachmentArea) else shape
            if inner is None:
                assert isinstance(shape, AttachmentArea)
                patches.append(geometry.patch(shape))
                continue
        points.append(inner[0])
        triangles.append(inner[1] + first)
        patches.append(Patch(first + np.arange(len(inner[0]))))
        first += len(inner[0])
    if len(points) == 1:
        return EndSurface(geometry.on(patches), takes)
    samples = samples_of(np.vstack(points), np.vstack(triangles), patches)
    return EndSurface(samples, (takes[0], 2.0 * takes[1]))


def samples_of(points: Floats, triangles: Ints, patches: Sequence[Patch]) -> PatchSamples:
    """Return attachment areas as one surface."""
    whole = [patch.points for patch in patches if not len(patch.segments)]
    if curves := [patch for patch in patches if len(patch.segments)]:
        band = band_along(points, triangles, curves)
        whole += [len(points) + np.arange(len(band[0]))] if len(band[0]) else [each.points for each in curves]
        points, triangles = np.vstack([points, band[0]]), np.vstack([triangles, len(points) + band[1]])
    return PatchSamples(points, triangles, np.unique(np.concatenate(whole)))


def _within(area: AttachmentArea, geometry: MuscleGeometry) -> tuple[Floats, Ints] | None:
    """Return the disc of an inner or surrounding ring."""
    if not area.closed:
        return None
    ring, disc = area.landmarks, discs_over([area.landmarks])
    share = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None, None]
    around = (1.0 - share) * ring + share * np.roll(ring, -1, axis=0)
    inside = (geometry.solids.depth(around.reshape(-1, 3)) > geometry.mean_edge).mean() > surfaces.NOISE
    patch = geometry.on([geometry.patch(area)]).area
    return disc if inside or patch > BULGE * _area(*disc) > 0.0 else None


def _area(points: Floats, triangles: Ints) -> float:
    """Return the area of triangles [mm^2]."""
    return float(np.linalg.norm(triangle_normals(points, triangles), axis=1).sum()) / 2.0


def _check_distance(points: Floats, geometry: MuscleGeometry, where: str) -> None:
    away = np.maximum(geometry.solids.distances(points), 0.0)
    allowed = max(FARTHEST * extent(geometry.points), geometry.mean_edge)
    worst = int(away.argmax())
    if away[worst] > allowed:
        problem = f"point {worst} is {away[worst]:.4g} from the muscle, of {allowed:.4g} allowed"
        raise InputError(where, problem, "check the muscle and the units")


def _share_in(first: EndSurface, second: EndSurface, geometry: MuscleGeometry) -> float:
    """Return the part of the first surface on the second."""
    if not len(second.samples.faces):
        return 0.0
    distances = second.samples.distances(first.samples.dense(SAMPLES))
    return float((distances < ROUGHNESS * geometry.mean_edge).mean())
