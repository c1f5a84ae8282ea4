"""Attachment areas and aponeuroses as end surfaces of fibres."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vtkmuscle.core.attachments.patches import discs_over
from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.fibres.between_areas import EndSurface
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.sampling import PatchSamples
from vtkmuscle.core.mesh.surface import extent
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.attachments import ROLES, SIDES, Aponeurosis, AttachmentArea
from vtkmuscle.data.muscle_geometry import MuscleGeometry

#: Ratio of surface within a ring to the ring's disc above which the ring surrounds the muscle, and fibres end
#: on the disc: a hemisphere has 2.
BULGE = 2.0
#: Largest part of a surface ring deeper in the muscle than a mean edge: a single landmark may be inexact.
DEEP = 0.05
#: Largest distance of an aponeurosis from its muscle, relative to the muscle's extent: finds wrong units.
FARTHEST = 0.05
#: Largest part of a muscle's surface that an aponeurosis may cover: the two sides of a sheet have half each.
COVERS = 0.6
#: Largest common part of two aponeuroses: rings may share a rim.
OVERLAP = 0.05
#: Distance of positions on a surface, in mean edges: rounding and projection, well below an edge.
TOUCHING = 0.1
#: Sample positions on a surface: standard error of a share of 5 % is 1 %.
SAMPLES = 512


def inner_areas(areas: Sequence[AttachmentArea], geometry: MuscleGeometry) -> tuple[Floats, Ints]:
    """Return the landmark discs with more than half deeper in the muscle than a mean edge."""

    def within(ring: Floats) -> bool:
        points, triangles = discs_over([ring])
        depths = geometry.solids.depth(points[triangles].mean(axis=1))
        return bool(len(depths) and np.median(depths) > geometry.mean_edge)

    return discs_over([area.landmarks for area in areas if area.closed and within(area.landmarks)])


def attached_surface(areas: Sequence[AttachmentArea], geometry: MuscleGeometry, where: str) -> EndSurface:
    """Return the end surface of a role's areas."""
    return _together(areas, geometry, where, takes=(0.0, np.inf))


def aponeurosis_surfaces(
    aponeuroses: Sequence[Aponeurosis],
    geometry: MuscleGeometry,
    where: str,
    areas: Sequence[AttachmentArea] = (),
) -> tuple[EndSurface, EndSurface]:
    """Return the proximal and the distal aponeurosis of a muscle.

    ValueError at `where` if a side is missing, if an aponeurosis is far from the muscle or covers the muscle,
    or if both overlap; with areas of origin and insertion also if proximal and distal are exchanged.
    """
    proximal, distal = (_aponeurosis(aponeuroses, side, geometry, where) for side in SIDES)
    overlap = max(_share_in(proximal, distal, geometry), _share_in(distal, proximal, geometry))
    if overlap > OVERLAP:
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


def _aponeurosis(
    aponeuroses: Sequence[Aponeurosis], side: str, geometry: MuscleGeometry, where: str
) -> EndSurface:
    """Return the aponeuroses of a side as one surface."""
    shapes: list[AttachmentArea | tuple[Floats, Ints]] = []
    label = f"{where}: {side}"
    for sheet in aponeuroses:
        if sheet.side == side:
            _check_distance(sheet.points, geometry, label)
            ring = AttachmentArea("origin", "", sheet.points, closed=True)
            shapes.append(ring if sheet.is_ring else (sheet.points, sheet.triangles))
    if not shapes:
        raise InputError(where, f"there is no {side} aponeurosis", "give both, proximal and distal")
    surface = _together(shapes, geometry, label, takes=(1.0, 1.0))
    share = surface.samples.area / _area(geometry.points, geometry.triangles)
    if share > COVERS:
        problem = f"the aponeurosis covers {100 * share:.0f} % of the muscle's surface"
        raise InputError(label, problem, "draw the ring around the fibre ends only")
    return surface


def _together(
    shapes: Sequence[AttachmentArea | tuple[Floats, Ints]],
    geometry: MuscleGeometry,
    where: str,
    *,
    takes: tuple[float, float],
) -> EndSurface:
    """Return areas and separate surfaces (points, triangles) as one end surface.

    `takes` is the range of an :class:`EndSurface` on the muscle's surface; a surface within the muscle has
    two faces.
    """
    patches: list[Ints] = []
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
        patches.append(first + np.arange(len(inner[0])))
        first += len(inner[0])
    patch = np.unique(np.concatenate(patches))
    alone = len(points) == 1
    samples = geometry.on(patch) if alone else PatchSamples(np.vstack(points), np.vstack(triangles), patch)
    return EndSurface(samples, (takes[0], takes[1] if alone else 2.0 * takes[1]))


def _within(area: AttachmentArea, geometry: MuscleGeometry) -> tuple[Floats, Ints] | None:
    """Return the disc of an inner or surrounding ring."""
    if not area.closed:
        return None
    ring, disc = area.landmarks, discs_over([area.landmarks])
    share = np.linspace(0.0, 1.0, 8, endpoint=False)[:, None, None]
    around = (1.0 - share) * ring + share * np.roll(ring, -1, axis=0)
    inside = (geometry.solids.depth(around.reshape(-1, 3)) > geometry.mean_edge).mean() > DEEP
    patch = geometry.on(geometry.patch(area)).area
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
    return float((distances < TOUCHING * geometry.mean_edge).mean())
