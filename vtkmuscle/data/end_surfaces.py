"""Attachment areas and aponeuroses as the surfaces that fibres end on, on a muscle or within it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vtkmuscle.core.attachments.rings import discs_over
from vtkmuscle.core.errors import InputError, errors_at
from vtkmuscle.core.fibres.between_areas import EndSurface
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.surface import extent
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.attachments import SIDES, Aponeurosis, AttachmentArea
from vtkmuscle.data.muscle_geometry import MuscleGeometry

#: A ring goes round the muscle where the muscle's surface within it has more than this many times the area of
#: the disc that spans the ring: a half ball has 2. Fibres then end on the disc.
BULGE = 2.0
#: Largest part of a ring on the surface that may be deeper in the muscle than a mean edge's length.
DEEP = 0.05
#: Positions from one landmark to the next at which that is measured.
PLACES = 8
#: Largest distance of an aponeurosis from its muscle, as a part of the muscle's extent.
FARTHEST = 0.05
#: Largest part of a muscle's surface that an aponeurosis may cover: the two sides of a sheet have half each.
COVERS = 0.6
#: Largest part of an aponeurosis that may lie in the other: rings may share a rim.
OVERLAP = 0.05
#: Positions nearer to a surface than this part of the mean edge's length are in it.
TOUCHING = 0.1
#: Number of positions on a surface for such comparisons.
SAMPLES = 512


def inner_areas(areas: Sequence[AttachmentArea], geometry: MuscleGeometry) -> tuple[Floats, Ints]:
    """Return points, and triangles (m, 3) that span the rings of landmarks which are within a muscle.

    That is, more than half of a ring's disc is deeper in the muscle than the mean length of its edges.
    """

    def within(ring: Floats) -> bool:
        points, triangles = discs_over([ring])
        depths = geometry.solids.depth(points[triangles].mean(axis=1))
        return bool(len(depths) and np.median(depths) > geometry.mean_edge)

    return discs_over([area.landmarks for area in areas if area.closed and within(area.landmarks)])


def attached_surface(areas: Sequence[AttachmentArea], geometry: MuscleGeometry, where: str) -> EndSurface:
    """Return the surface that the areas of one role, one or more, cover of a muscle, or span within it."""
    return _together(areas, geometry, where, takes=(0.0, np.inf))


def aponeurosis_surfaces(
    aponeuroses: Sequence[Aponeurosis],
    geometry: MuscleGeometry,
    where: str,
    landmarks: tuple[Floats, Floats] | None = None,
) -> tuple[EndSurface, EndSurface]:
    """Return the proximal and the distal aponeurosis of a muscle.

    Raises a ValueError at `where` if a side is missing, one is far from the muscle or covers it, or the two
    overlap; if the proximal one is on the insertion's side of the distal one, where the landmarks, (n, 3) of
    the origin and the insertion, are known.
    """
    proximal, distal = (_aponeurosis(aponeuroses, side, geometry, where) for side in SIDES)
    overlap = max(_share_in(proximal, distal, geometry), _share_in(distal, proximal, geometry))
    if overlap > OVERLAP:
        raise InputError(
            where,
            f"the aponeuroses overlap: {100 * overlap:.0f} % of one is in the other",
            "make one of them smaller; fibres go from the one to the other",
        )
    if landmarks is not None:
        axis = landmarks[1].mean(axis=0) - landmarks[0].mean(axis=0)
        low, high = (surface.samples.dense(SAMPLES).mean(axis=0) @ axis for surface in (proximal, distal))
        if low > high:
            raise InputError(
                where,
                "the proximal aponeurosis is nearer to the insertion than the distal one is",
                "exchange proximal and distal, or the roles origin and insertion of the attachments",
            )
    return proximal, distal


def _aponeurosis(
    aponeuroses: Sequence[Aponeurosis], side: str, geometry: MuscleGeometry, where: str
) -> EndSurface:
    """Return all aponeuroses of one side as one surface."""
    shapes: list[AttachmentArea | tuple[Floats, Ints]] = []
    label = f"{where}: {side}"
    for one in aponeuroses:
        if one.side == side:
            _check_near(one.points, geometry, label)
            ring = AttachmentArea("origin", "", one.points, closed=True)
            shapes.append(ring if one.is_ring else (one.points, one.triangles))
    if not shapes:
        raise InputError(where, f"there is no {side} aponeurosis", "give both, proximal and distal")
    surface = _together(shapes, geometry, label, takes=(1.0, 1.0))
    share = surface.samples.area / _area(geometry.points, geometry.triangles)
    if share > COVERS:
        raise InputError(
            label,
            f"the aponeurosis covers the muscle: its area is {100 * share:.0f} % of the muscle's surface",
            "draw its ring round the part of the surface that fibres end on",
        )
    return surface


def _together(
    shapes: Sequence[AttachmentArea | tuple[Floats, Ints]],
    geometry: MuscleGeometry,
    where: str,
    *,
    takes: tuple[float, float],
) -> EndSurface:
    """Return areas, and surfaces of their own (points, triangles), as one that fibres end on.

    `takes` is that of an :class:`EndSurface` on the muscle's surface; one within it has two faces.
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
    most = takes[1] if len(points) == 1 else 2.0 * takes[1]
    patch = np.unique(np.concatenate(patches))
    return EndSurface(np.vstack(points), np.vstack(triangles), patch, (takes[0], most))


def _within(area: AttachmentArea, geometry: MuscleGeometry) -> tuple[Floats, Ints] | None:
    """Return the disc of a ring that is within the muscle or goes round it, None for any other area."""
    if not area.closed:
        return None
    ring, disc = area.landmarks, discs_over([area.landmarks])
    share = np.linspace(0.0, 1.0, PLACES, endpoint=False)[:, None, None]
    around = (1.0 - share) * ring + share * np.roll(ring, -1, axis=0)
    inside = (geometry.solids.depth(around.reshape(-1, 3)) > geometry.mean_edge).mean() > DEEP
    patch = EndSurface(geometry.points, geometry.triangles, geometry.patch(area)).samples.area
    return disc if inside or patch > BULGE * _area(*disc) > 0.0 else None


def _area(points: Floats, triangles: Ints) -> float:
    """Return the area of triangles [mm^2]."""
    return float(np.linalg.norm(triangle_normals(points, triangles), axis=1).sum()) / 2.0


def _check_near(points: Floats, geometry: MuscleGeometry, where: str) -> None:
    away = np.maximum(geometry.solids.distances(points), 0.0)
    allowed = max(FARTHEST * extent(geometry.points), geometry.mean_edge)
    worst = int(away.argmax())
    if away[worst] > allowed:
        raise InputError(
            where,
            f"the aponeurosis is far from its muscle: point {worst} is {away[worst]:.4g} from it, and "
            f"at most {allowed:.4g} is allowed",
            "check whose it is, and the units",
        )


def _share_in(one: EndSurface, other: EndSurface, geometry: MuscleGeometry) -> float:
    """Return the part of a surface that lies in another."""
    if not len(other.faces):
        return 0.0
    distances = other.tree.nearest(one.samples.dense(SAMPLES))[2]
    return float((distances < TOUCHING * geometry.mean_edge).mean())
