"""Fibre ends of Kohout, Clapworthy, Martelli, Viceconti 2012, section 3.4, as printed.

Each fibre is cut at the plane through the extremal landmark and gets one more segment, to the point of the
area that is closest to the ray of its last one. Other than in :mod:`~vtkmuscle.core.fibres.trimming`, fibres
do not share the area out, so that many may end in one point of its rim; a fibre of which the plane leaves
nothing keeps its end; and points are not spaced anew, so that fibres have different numbers of them.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from vtkmuscle.core.fibres.trimming import EndArea
from vtkmuscle.core.mesh.surface import faces_between
from vtkmuscle.core.types import Floats, Ints


def ends_as_printed(
    points: Floats, offsets: Ints, *, axis: Floats, origin: EndArea, insertion: EndArea
) -> tuple[Floats, Ints]:
    """Return fibres cut at both planes and led on to the areas.

    Parameters
    ----------
    points : (n, 3) array
        Fibre points [mm], from the origin to the insertion.
    offsets : (k + 1,) int array
        First point of each fibre, and n. A fibre has at least two points.
    axis : (3,) array
        Unit vector from the origin to the insertion.
    origin, insertion : EndArea
        The two sides.

    Returns
    -------
    points : (j, 3) array
        [mm].
    offsets : (k + 1,) int array
        First point of each fibre, and j.
    """
    lines = []
    sides = [(_area_triangles(insertion), axis, insertion), (_area_triangles(origin), -axis, origin)]
    for first, last in pairwise(offsets):
        line = points[first:last]
        for corners, direction, area in sides:
            line = _extended(line, direction, float((area.landmarks @ direction).min()), corners)[::-1]
        lines.append(line)
    return np.vstack(lines), np.append(0, np.cumsum([len(line) for line in lines]))


def _area_triangles(area: EndArea) -> Floats:
    """Return the corners (m, 3, 3) of an area's triangles; its points as such where it has none."""
    triangles = faces_between(area.triangles, area.patch)
    if not len(triangles):
        triangles = np.repeat(area.patch[:, None], 3, axis=1)
    return np.ascontiguousarray(area.points[triangles])


def _extended(line: Floats, direction: Floats, height: float, corners: Floats) -> Floats:
    """Return a line (n, 3), cut at a plane near its end, with a segment from there to an area."""
    beyond = line @ direction - height
    if beyond[0] >= 0.0:
        return line
    first = int(np.argmax(beyond > 0.0)) if (beyond > 0.0).any() else len(line)
    kept = line[:first]
    if first < len(line):
        t = beyond[first - 1] / (beyond[first - 1] - beyond[first])
        if t > 0.0:
            kept = np.vstack([kept, line[first - 1] + t * (line[first] - line[first - 1])])
    back = 1
    while back < len(line) - 1 and len(kept) > 1 and np.array_equal(kept[-1], kept[-1 - back]):
        back += 1
    ahead = kept[-1] - kept[-1 - back] if len(kept) > back else line[1] - line[0]
    length = float(np.linalg.norm(ahead))
    if length == 0.0:
        return kept
    return np.vstack([kept, closest_to_ray(kept[-1], ahead / length, corners)])


def closest_to_ray(start: Floats, ahead: Floats, corners: Floats) -> Floats:
    """Return the point of triangles that is closest to a ray; of several on it the first.

    Parameters
    ----------
    start, ahead : (3,) arrays
        Where the ray begins [mm], and its unit direction.
    corners : (m, 3, 3) array
        Of the triangles [mm].

    Returns
    -------
    (3,) array
        [mm].
    """
    a = corners[:, 0]
    e, f = corners[:, 1] - a, corners[:, 2] - a
    normals = np.cross(e, f)
    sizes, off = (normals * normals).sum(axis=1), (normals * (a - start)).sum(axis=1)
    places, ways, distances = [], [], []
    with np.errstate(divide="ignore", invalid="ignore"):  # triangles without area, or along the ray
        through = off / (normals @ ahead)
        # Through a triangle, or from the ray's start straight to it.
        for at, way, distance in (
            (start + through[:, None] * ahead, through, np.zeros(len(a))),
            (start + (off / sizes)[:, None] * normals, np.zeros(len(a)), np.sqrt(off * off / sizes)),
        ):
            u = (normals * np.cross(at - a, f)).sum(axis=1) / sizes
            v = (normals * np.cross(e, at - a)).sum(axis=1) / sizes
            met = (way >= 0.0) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
            places.append(at[met])
            ways.append(way[met])
            distances.append(distance[met])
    p, edges = corners.reshape(-1, 3), (np.roll(corners, -1, axis=1) - corners).reshape(-1, 3)
    s, t = _nearest(start - p, ahead, edges)
    places.append(p + s[:, None] * edges)
    ways.append(t)
    distances.append(np.linalg.norm(start + t[:, None] * ahead - places[-1], axis=1))
    best = np.lexsort((np.concatenate(ways), np.concatenate(distances)))[0]
    closest: Floats = np.vstack(places)[best]
    return closest


def _nearest(to_start: Floats, ahead: Floats, edges: Floats) -> tuple[Floats, Floats]:
    """Return where on edges (k, 3) (0 to 1), and how far along a ray (0 and more), the two are closest.

    Ericson 2005, *Real-time collision detection*, section 5.1.9.
    """
    ee, ea = (edges * edges).sum(axis=1), edges @ ahead
    es, as_ = (edges * to_start).sum(axis=1), to_start @ ahead
    apart = ee - ea * ea
    s = np.divide(es - ea * as_, apart, out=np.zeros(len(ee)), where=apart > 1e-14 * ee).clip(0.0, 1.0)
    t = s * ea - as_
    behind = np.divide(es, ee, out=np.zeros(len(ee)), where=ee > 0.0).clip(0.0, 1.0)
    return np.where(t < 0.0, behind, s), np.maximum(t, 0.0)
