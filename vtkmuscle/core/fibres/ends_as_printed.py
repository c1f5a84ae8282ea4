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
from vtkmuscle.core.jit import array_kernel
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
            line = _led_on(line, direction, float((area.landmarks @ direction).min()), corners)[::-1]
        lines.append(line)
    return np.vstack(lines), np.append(0, np.cumsum([len(line) for line in lines]))


def _area_triangles(area: EndArea) -> Floats:
    """Return the corners (m, 3, 3) of an area's triangles; its points as such where it has none."""
    attached = np.zeros(len(area.points), dtype=np.bool_)
    attached[area.patch] = True
    triangles = area.triangles[attached[area.triangles].all(axis=1)]
    if not len(triangles):
        triangles = np.repeat(area.patch[:, None], 3, axis=1)
    corners: Floats = np.ascontiguousarray(area.points[triangles])
    return corners


def _led_on(line: Floats, direction: Floats, height: float, corners: Floats) -> Floats:
    """Return a line (n, 3) without what is beyond a plane at its end, with a segment to an area."""
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
    led_on: Floats = np.vstack([kept, closest_to_ray(kept[-1], ahead / length, corners)])
    return led_on


@array_kernel
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
    best, along = np.inf, np.inf
    found: Floats = corners[0, 0].copy()
    for triangle in range(len(corners)):
        a = corners[triangle, 0]
        e, f = corners[triangle, 1] - a, corners[triangle, 2] - a
        normal = np.cross(e, f)
        size = (normal * normal).sum()
        if size > 0.0:
            # Through the triangle, or from its start straight to it.
            steep = (normal * ahead).sum()
            off = (normal * (a - start)).sum()
            for case in range(2):
                if case == 0:
                    if steep == 0.0 or off / steep < 0.0:
                        continue
                    at, t = start + off / steep * ahead, off / steep
                else:
                    at, t = start + off / size * normal, 0.0
                u = (normal * np.cross(at - a, f)).sum() / size
                v = (normal * np.cross(e, at - a)).sum() / size
                if u >= 0.0 and v >= 0.0 and u + v <= 1.0:
                    distance = 0.0 if case == 0 else np.sqrt(off * off / size)
                    if distance < best or (distance == best and t < along):
                        best, along, found = distance, t, at
        for side in range(3):
            p = corners[triangle, side]
            edge = corners[triangle, (side + 1) % 3] - p
            s, t = _nearest(start - p, ahead, edge)
            at = p + s * edge
            way = start + t * ahead - at
            distance = np.sqrt((way * way).sum())
            if distance < best or (distance == best and t < along):
                best, along, found = distance, t, at
    return found


@array_kernel
def _nearest(to_start: Floats, ahead: Floats, edge: Floats) -> tuple[float, float]:
    """Return where on an edge (0 to 1), and how far along a ray (0 and more), the two are closest.

    Ericson 2005, *Real-time collision detection*, section 5.1.9.
    """
    ee, ea = (edge * edge).sum(), (edge * ahead).sum()
    es, as_ = (edge * to_start).sum(), (ahead * to_start).sum()
    if ee == 0.0:
        return 0.0, max(0.0, -as_)
    apart = ee - ea * ea
    s = (es - ea * as_) / apart if apart > 1e-14 * ee else 0.0
    s = min(max(s, 0.0), 1.0)
    t = s * ea - as_
    if t < 0.0:
        t = 0.0
        s = min(max(es / ee, 0.0), 1.0)
    return s, t
