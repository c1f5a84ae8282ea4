"""What fibres end on: attachment areas and aponeuroses as surfaces, on a muscle or within it."""

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


def inner_areas(areas: Sequence[AttachmentArea], geometry: MuscleGeometry) -> tuple[Floats, Ints]:
    """Return triangles (m, 3) that span those rings of landmarks which are within a muscle, and points.

    That is, more than half of what a ring spans is deeper in the muscle than the mean length of its edges.
    """

    def within(ring: Floats) -> bool:
        points, triangles = discs_over([ring])
        depths = geometry.solids.depth(points[triangles].mean(axis=1))
        return bool(len(depths) and np.median(depths) > geometry.mean_edge)

    return discs_over([area.landmarks for area in areas if area.closed and within(area.landmarks)])


#: A ring whose part of the muscle's surface has more than this many times the area that the ring spans by
#: itself goes round the muscle: what lies within it counts. A half ball has 2.
BULGE = 2.0
#: A ring of which more than this part is deeper in the muscle than a mean edge is long does not lie on it.
DEEP = 0.05
#: Places at which that is looked at on the way from one landmark to the next.
PLACES = 8
#: An aponeurosis is no farther from its muscle than this part of the muscle's extent.
FARTHEST = 0.05
#: Part of a muscle's surface beyond which an aponeurosis covers the muscle: the two sides of a sheet have
#: half each.
COVERS = 0.6
#: Two aponeuroses overlap where more than this part of one is in the other: rings may share a rim.
OVERLAP = 0.05
#: What is nearer to a surface than this part of the mean edge's length is in it.
TOUCHING = 0.1
#: Positions by which that is found out.
SAMPLES = 512


def attached_surface(areas: Sequence[AttachmentArea], geometry: MuscleGeometry, where: str) -> EndSurface:
    """Return what the areas of one role, one or more, cover of a muscle, or span within it.

    Raises
    ------
    ValueError
        If the landmarks of one cannot be on this muscle.
    """
    shapes = [Aponeurosis(SIDES[0], area.landmarks) if area.closed else area for area in areas]
    return _together(shapes, geometry, where)


def aponeurosis_surfaces(
    aponeuroses: Sequence[Aponeurosis], geometry: MuscleGeometry, where: str
) -> tuple[EndSurface, EndSurface]:
    """Return the proximal and the distal aponeurosis of a muscle.

    Raises
    ------
    ValueError
        If a side is missing, one is far from the muscle or covers it, or the two overlap.
    """
    surfaces = []
    for side in SIDES:
        mine = [one for one in aponeuroses if one.side == side]
        if not mine:
            raise InputError(where, f"there is no {side} aponeurosis", "give both, proximal and distal")
        label = f"{where}: {side}"
        for one in mine:
            _check_near(one, geometry, label)
        surfaces.append(_together(mine, geometry, label, fibres=True))
        whole = np.linalg.norm(triangle_normals(geometry.points, geometry.triangles), axis=1).sum() / 2.0
        share = surfaces[-1].samples.area / whole
        if share > COVERS:
            raise InputError(
                label,
                f"the aponeurosis covers the muscle: its area is {100 * share:.0f} % of the muscle's surface",
                "draw its ring round the part of the surface that fibres end on",
            )
    proximal, distal = surfaces
    shares = [_share_in(one, other, geometry) for one, other in ((proximal, distal), (distal, proximal))]
    if max(shares) > OVERLAP:
        raise InputError(
            where,
            f"the aponeuroses overlap: {100 * max(shares):.0f} % of one is in the other",
            "make one of them smaller; fibres go from the one to the other",
        )
    return proximal, distal


def check_sides(
    surfaces: tuple[EndSurface, EndSurface], origin: Floats, insertion: Floats, where: str
) -> None:
    """Raise where the proximal aponeurosis is on the insertion's side of the distal one.

    Parameters
    ----------
    surfaces : (EndSurface, EndSurface)
        Proximal, distal.
    origin, insertion : (n, 3) arrays
        Landmarks of the muscle's ends on its bones [mm].
    where : str
        Named in the error.
    """
    axis = insertion.mean(axis=0) - origin.mean(axis=0)
    low, high = (surface.samples.dense(SAMPLES).mean(axis=0) @ axis for surface in surfaces)
    if low > high:
        raise InputError(
            where,
            "the proximal aponeurosis is nearer to the insertion than the distal one is",
            "exchange proximal and distal, or the roles origin and insertion of the attachments",
        )


def _together(
    shapes: Sequence[Aponeurosis | AttachmentArea],
    geometry: MuscleGeometry,
    where: str,
    *,
    fibres: bool = False,
) -> EndSurface:
    """Return all shapes as one; ``fibres`` says that these themselves end there, and not their tendons."""
    patches: list[Ints] = []
    points, triangles, first = [geometry.points], [geometry.triangles], len(geometry.points)
    for number, shape in enumerate(shapes):
        with errors_at(f"{where} {number}"):
            inner = _within(shape, geometry)
            if inner is None:
                patches.append(geometry.patch(_as_area(shape)))
                continue
        points.append(inner[0])
        triangles.append(inner[1] + first)
        patches.append(first + np.arange(len(inner[0])))
        first += len(inner[0])
    takes = (1.0, 1.0 if len(points) == 1 else 2.0) if fibres else (0.0, np.inf)
    return EndSurface(np.vstack(points), np.vstack(triangles), np.unique(np.concatenate(patches)), takes)


def _within(shape: Aponeurosis | AttachmentArea, geometry: MuscleGeometry) -> tuple[Floats, Ints] | None:
    """Return the surface of its own that a shape is, None for a part of the muscle's surface."""
    if isinstance(shape, AttachmentArea):
        return None
    if not shape.is_ring:
        return shape.points, shape.triangles
    disc = discs_over([shape.points])
    share = np.linspace(0.0, 1.0, PLACES, endpoint=False)[:, None, None]
    around = (1.0 - share) * shape.points + share * np.roll(shape.points, -1, axis=0)
    inside = (geometry.solids.depth(around.reshape(-1, 3)) > geometry.mean_edge).mean() > DEEP
    patch = EndSurface(geometry.points, geometry.triangles, geometry.patch(_as_area(shape))).samples.area
    flat = float(np.linalg.norm(triangle_normals(*disc), axis=1).sum()) / 2.0
    return disc if inside or patch > BULGE * flat > 0.0 else None


def _as_area(shape: Aponeurosis | AttachmentArea) -> AttachmentArea:
    if isinstance(shape, AttachmentArea):
        return shape
    return AttachmentArea("origin", "", shape.points, closed=True)


def _check_near(one: Aponeurosis, geometry: MuscleGeometry, where: str) -> None:
    away = np.maximum(geometry.solids.distances(one.points), 0.0)
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
    """Return which part of a surface lies in another."""
    if not len(other.faces):
        return 0.0
    distances = other.tree.nearest(one.samples.dense(SAMPLES))[2]
    return float((distances < TOUCHING * geometry.mean_edge).mean())
