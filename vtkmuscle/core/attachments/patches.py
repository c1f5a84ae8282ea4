"""Attachment areas on the muscle, from landmarks digitised on a bone.

The landmarks' boundary is projected onto the muscle, neighbours are joined by shortest paths along edges, and
the patch inside is the attachment: Kohout, Cervenka 2021, section 3.3, doi:10.1007/978-3-030-72379-8_24,
after Kohout, Kukacka 2014, doi:10.1111/cgf.12354.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import triangle_normals, vertex_normals
from vtkmuscle.core.mesh.polylines import segment_distances
from vtkmuscle.core.mesh.surface import (
    edge_lengths,
    numbered_edges,
    point_components,
    points_in_box,
    signed_volume,
)
from vtkmuscle.core.types import Floats, Ints

#: Penalty s on edges away from the chord: at a distance of a chords an edge counts (1 + s a^2) times its
#: length. On a sphere of equal triangles paths are 6 % of the chord off the great circle with 10, 16 % (at
#: most 38 %) with 0, and equally long.
_STRAIGHTNESS = 10.0
#: Nearly all paths stay within this many chords of the chord's middle: they are sought there first.
_REACH = 2.0


def geodesic_curve(points: Floats, edges: Ints, vertices: Ints, *, closed: bool) -> Ints:
    """Return point ids (k,) along the shortest paths from each vertex to the next, joints once.

    On a mesh of like triangles many paths are nearly as short as the shortest, and that one may bulge by a
    third of its chord. Edges count as longer the farther they are from the chord, so that the path keeps near
    to the straight line between the landmarks. The ids of the vertices (j,) are in order; if `closed`, the
    last one is joined to the first. Raises a ValueError if none of the edges (m, 2) connect two neighbours.
    """
    ends = np.append(vertices[1:], vertices[:1]) if closed else vertices[1:]
    middles = np.ascontiguousarray(0.5 * (points[edges[:, 0]] + points[edges[:, 1]]).T)
    curve = [vertices[:1]]
    for start, end in zip(vertices[: len(ends)], ends, strict=True):
        path = _shortest_path(points, edges, middles, int(start), int(end), _REACH)
        if not len(path):
            path = _shortest_path(points, edges, middles, int(start), int(end), np.inf)
        if not len(path):
            raise InputError(
                "",
                f"two neighbouring landmarks are nearest to the muscle points {start} and {end}, which no "
                "edges connect: the muscle is in several pieces",
                "split the attachment, or join the pieces",
            )
        curve.append(path[1:])
    return np.concatenate(curve)


def _shortest_path(points: Floats, edges: Ints, middles: Floats, start: int, end: int, reach: float) -> Ints:
    """Return the points of the shortest path, both ends included; none where there is no path.

    Dijkstra 1959, doi:10.1007/BF01386390. Edges whose middle (3, k) is farther from the chord's middle than
    `reach` chords, along any axis, are left out.
    """
    chord = points[end] - points[start]
    square = max(float(chord @ chord), 1e-300)
    near = np.ones(len(edges), dtype=np.bool_)
    if np.isfinite(reach):
        for along, middle in zip(middles, points[start] + 0.5 * chord, strict=True):
            near &= np.abs(along - middle) <= reach * np.sqrt(square)
    edges, away = edges[near], middles.T[near] - points[start]
    aside = (np.cross(away, chord) ** 2).sum(axis=1) / square**2  # squared, in chords
    weights = edge_lengths(points, edges) * (1.0 + _STRAIGHTNESS * aside)
    graph = coo_array((weights, (edges[:, 0], edges[:, 1])), shape=(len(points), len(points))).tocsr()
    before = dijkstra(graph, directed=False, indices=start, return_predecessors=True)[1]
    path = [end]
    while path[-1] != start:
        if before[path[-1]] < 0:
            return np.empty(0, dtype=np.int64)
        path.append(int(before[path[-1]]))
    return np.array(path[::-1], dtype=np.int64)


#: Landmarks farther from the muscle than this part of its box's diagonal belong to something else.
FARTHEST_LANDMARK = 0.2
#: A ring whose smaller side is less than this part of the surface encloses that side.
CLEAR_SHARE = 0.2
#: Landmarks whose width is below this part of their length lie on a line and enclose nothing.
_FLATNESS = 1e-3
#: Landmarks nearer to points of the muscle than this part of its box's diagonal are these points.
ON_POINTS = 1e-6
#: A step along the normal of a point that faces the bone leads nearer to it by this part of the step, at
#: least; that of a point that looks away leads as much farther. Between them is the rim of a muscle.
FACING = 0.5


def attachment_patch(
    points: Floats,
    triangles: Ints,
    landmarks: Floats,
    closed: bool,
    *,
    tolerance: float | None = None,
    bone_distance: Callable[[Floats], Floats] | None = None,
) -> Ints:
    """Return the ids of the muscle's points that an attachment area covers, (k,), ascending.

    The landmarks are projected to the nearest points of the muscle, on the side that faces the bone where
    one is within reach, and neighbours joined by geodesics along edges. A ring cuts the surface: the patch
    is all that it cuts off except the largest part, its own points included, so that a ring which crosses
    itself keeps all its loops, whichever way round it runs. Where the parts are of like size, the one
    nearer to the bone is the patch. An open curve, a ring of landmarks on a line, and a ring that cuts
    nothing off give the points within a tolerance of the projected curve, on its side of the muscle.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        The muscle [mm].
    landmarks : (k, 3) array
        In boundary order [mm]; they may lie off the muscle.
    closed : bool
        True where the landmarks are a ring.
    tolerance : float, optional
        For curves: how far from the projected curve a point may be [mm]. Default: the mean edge length.
    bone_distance : callable, optional
        From points (j, 3) to their distances (j,) from the bone, negative inside; without it landmarks go
        to either side of the muscle, and the smaller side of a ring is its inside.

    Raises
    ------
    ValueError
        If there are no landmarks, if one is too far from the muscle, or if two neighbours are on parts
        of the muscle that are not connected.
    """
    edges, edge_of = numbered_edges(triangles)
    usual = float(edge_lengths(points, edges).mean())
    within = usual if tolerance is None else tolerance
    vertices = _nearest_vertices(points, triangles, landmarks, (within, usual), bone_distance)
    ring = closed and not _on_a_line(landmarks)
    curve = geodesic_curve(points, edges, vertices, closed=ring)
    if ring:
        parts = _parts_cut_by(edges, edge_of, curve, len(points))
        patch = _enclosed(points, triangles, curve, parts, bone_distance)
        if len(patch):
            return patch
    return _near_curve(points, edges, curve, within)


def _nearest_vertices(
    points: Floats,
    triangles: Ints,
    landmarks: Floats,
    lengths: tuple[float, float],
    bone_distance: Callable[[Floats], Floats] | None,
) -> Ints:
    """Return the nearest used point for each landmark, neighbours never the same.

    Landmarks off a thin muscle, or within it, may be nearer to the face that looks away from the bone; the
    patch would be there. So points that face the bone are preferred, unless all landmarks are points already.
    The lengths are the tolerance and the muscle's mean edge.
    """
    if not len(landmarks):
        raise InputError("", "the attachment has no landmarks")
    used = np.flatnonzero(np.bincount(triangles.reshape(-1), minlength=len(points)))
    tree = cKDTree(points[used])
    offsets, nearest = tree.query(landmarks)
    diagonal = float(np.linalg.norm(np.ptp(points[used], axis=0)))
    limit = max(FARTHEST_LANDMARK * diagonal, lengths[0])
    worst = int(np.argmax(offsets))
    if offsets[worst] > limit:
        raise InputError(
            "",
            f"landmark {worst} is {offsets[worst]:.4g} from the muscle, whose size is {diagonal:.4g}; at "
            f"most {limit:.4g} is accepted",
            "leave this attachment out if it is another muscle's or out of the scene, and check the units, "
            "or give a larger distance",
        )
    if bone_distance is not None and offsets[worst] > ON_POINTS * diagonal:
        _prefer_facing(points, triangles, landmarks, nearest, (tree, used, limit, lengths[1]), bone_distance)
    vertices: Ints = used[nearest].astype(np.int64)
    distinct: Ints = vertices[np.append(True, vertices[1:] != vertices[:-1])]
    return distinct


def _prefer_facing(
    points: Floats,
    triangles: Ints,
    landmarks: Floats,
    nearest: Ints,
    among: tuple[cKDTree, Ints, float, float],
    bone_distance: Callable[[Floats], Floats],
) -> None:
    """Give each landmark the nearest point that faces the bone, where there is one within the limit.

    `nearest` (k,), changed in place, has for each landmark a number among the used points; `among` are the
    tree of these points, their ids, the limit, and how far to look along their normals.
    """
    tree, used, limit, step = among
    outward = vertex_normals(points, triangles) * np.sign(signed_volume(points, triangles) or 1.0)
    waiting, count = np.arange(len(landmarks)), 1
    while len(waiting):
        offsets, found = tree.query(landmarks[waiting], [*range(count // 2 + 1, count + 1)])
        ids = used[np.minimum(found, len(used) - 1)].ravel()
        # Landmarks that are nearest to the rim stay there, but none is sent there.
        least = -FACING if count == 1 else FACING
        nearer = bone_distance(points[ids]) - bone_distance(points[ids] + step * outward[ids])
        facing = (nearer / step).reshape(found.shape) >= least
        facing &= offsets <= limit
        settled = facing.any(axis=1)
        nearest[waiting[settled]] = found[settled, facing[settled].argmax(axis=1)]
        waiting = waiting[~settled & (offsets[:, -1] <= limit)]
        count *= 2


def _on_a_line(landmarks: Floats) -> bool:
    """Return True where landmarks are fewer than three, or all on one straight line."""
    spread = np.linalg.svd(landmarks - landmarks.mean(axis=0), compute_uv=False)
    return len(landmarks) < 3 or bool(spread[1] <= _FLATNESS * spread[0])


def _enclosed(
    points: Floats,
    triangles: Ints,
    loop: Ints,
    parts: tuple[Ints, Ints],
    bone_distance: Callable[[Floats], Floats] | None,
) -> Ints:
    """Return the points inside a closed loop of edges, none where the loop cuts nothing off.

    Triangles are flooded across all edges but the loop's. The largest of these parts that touches the loop is
    the outside. The loop may be any: geodesics may share edges, touch and cross.
    """
    labels, at_loop = parts
    if len(at_loop) < 2:
        return np.zeros(0, dtype=np.int64)
    areas = np.linalg.norm(triangle_normals(points, triangles), axis=1) / 2.0
    part_areas = np.bincount(labels, weights=areas)
    largest = at_loop[np.argmax(part_areas[at_loop])]
    inside = np.isin(labels, at_loop) & (labels != largest)
    outside = labels == largest
    share = areas[inside].sum() / (areas[inside].sum() + areas[outside].sum())
    # A flat muscle may be attached with a whole face, and then area does not tell the face on the bone
    # from the other. (Nor does the plane of the ring: over a hollow bone the wrong face is nearer to it.)
    if bone_distance is not None and share > CLEAR_SHARE:
        distances = bone_distance(points[triangles].mean(axis=1))
        nearness = [np.average(distances[part], weights=areas[part]) for part in (inside, outside)]
        if nearness[1] < nearness[0]:
            inside = outside
    return np.union1d(triangles[inside], loop)


def _parts_cut_by(edges: Ints, edge_of: Ints, loop: Ints, n_points: int) -> tuple[Ints, Ints]:
    """Return the part of each triangle (m,) in the surface cut along the loop, and the parts at the loop."""
    cut = np.isin(_edge_keys(edges, n_points), _edge_keys(np.column_stack([loop[:-1], loop[1:]]), n_points))
    order = np.argsort(edge_of, kind="stable")
    owners = order // 3  # the triangle of each half-edge
    number = edge_of[order]
    joined = (number[1:] == number[:-1]) & ~cut[number[1:]]
    labels = point_components(len(edge_of) // 3, np.column_stack([owners[:-1], owners[1:]])[joined])
    return labels, np.unique(labels[owners[cut[number]]])


def _edge_keys(edges: Ints, n_points: int) -> Ints:
    keys: Ints = np.sort(edges, axis=1) @ np.array([n_points, 1])
    return keys


def _near_curve(points: Floats, edges: Ints, curve: Ints, tolerance: float) -> Ints:
    """Return the points of a curve of edges, and those within a tolerance that edges connect to it.

    The other face of a thin muscle may be as near, but it is not connected within the tolerance.
    """
    near = np.zeros(len(points), dtype=np.bool_)
    low, high = points[curve].min(axis=0) - tolerance, points[curve].max(axis=0) + tolerance
    candidates = points_in_box(points, low, high)
    near[candidates] = np.linalg.norm(points[candidates] - points[curve[0]], axis=1) <= tolerance
    for start, end in pairwise(points[curve]):
        near[candidates] |= segment_distances(points[candidates], start, end) <= tolerance
    near[curve] = True
    labels = point_components(len(points), edges[near[edges].all(axis=1)])
    return np.flatnonzero(near & np.isin(labels, labels[curve])).astype(np.int64)
