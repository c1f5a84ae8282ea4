"""Attachment areas on the muscle, from landmarks on a bone.

The landmarks' boundary is projected onto the muscle, shortest paths along edges join neighbours, and the
enclosed patch is the attachment: Kohout, Cervenka 2021, section 3.3, doi:10.1007/978-3-030-72379-8_24, after
Kohout, Kukacka 2014, doi:10.1111/cgf.12354.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh import surface as surfaces
from vtkmuscle.core.mesh.normals import triangle_normals, vertex_normals
from vtkmuscle.core.mesh.rest_shape import SLIVER
from vtkmuscle.core.mesh.surface import diagonal
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.core.types import SAME, FloatMap, Floats, Ints

#: Penalty s on edges away from the chord: at a distance of a chords an edge counts (1 + s a^2) times its
#: length. On a sphere of equal triangles paths deviate by 6 % of the chord from the great circle with 10, by
#: 16 % (at most 38 %) with 0, at equal lengths.
_STRAIGHTNESS = 10.0


def geodesic_curve(points: Floats, edges: Ints, vertices: Ints, *, closed: bool) -> Ints:
    """Return point ids (k,) along shortest paths between vertices.

    On a mesh of similar triangles many paths are nearly as short as the shortest, which may bulge by a third
    of its chord. Edges count as longer the farther they are from the chord, so the path stays near the
    straight line between landmarks. The ids of the vertices (j,) are in order; `closed` joins the last to the
    first. Raises a ValueError if the edges (m, 2) do not connect two neighbours.
    """
    ends = np.append(vertices[1:], vertices[:1]) if closed else vertices[1:]
    starts = np.searchsorted(edges[:, 0], np.arange(len(points) + 1))
    middles = 0.5 * (points[edges[:, 0]] + points[edges[:, 1]])
    lengths = surfaces.edge_lengths(points, edges)
    curve = vertices[:1].tolist()
    for start, end in zip(vertices[: len(ends)].tolist(), ends.tolist(), strict=True):
        chord = points[end] - points[start]
        square = max(float(chord @ chord), 1e-100)
        aside = (np.cross(middles - points[start], chord) ** 2).sum(axis=1) / square**2  # squared, in chords
        weights = lengths * (1.0 + _STRAIGHTNESS * aside)
        graph = csr_array((weights, edges[:, 1], starts), shape=(len(points), len(points)))
        for limit in (2.0 * float(np.sqrt(square)), np.inf):  # few ways are longer than twice the chord
            before = dijkstra(graph, directed=False, indices=start, return_predecessors=True, limit=limit)[1]
            if before[end] >= 0 or start == end:
                break
        else:
            problem = f"points {start} and {end}, next to landmarks, are on separate pieces of the muscle"
            raise InputError("", problem, "split the attachment, or join the pieces")
        path = [end]
        while path[-1] != start:
            path.append(int(before[path[-1]]))
        curve += path[-2::-1]
    return np.array(curve, dtype=np.int64)


#: Largest distance of a landmark from its muscle, as a part of the muscle's diagonal: finds wrong units, of a
#: factor of ten or more.
FARTHEST = 0.2
#: Share of the surface below which the smaller side of a ring is certainly its inside: the rest of a muscle
#: that lies on its bone is as near. With 0 to 1 areas of 20 muscles of hips, knees and arms are the same.
CLEAR_SHARE = 0.2
#: Least approach to the bone by a step along the normal of a facing point, as a part of the step; a point
#: that faces away recedes as much. Points between are on the rim of the muscle. If all points faced the bone,
#: fibres of four muscles of a real hip would change by 0.04 to 0.4 mm.
FACING = 0.5
#: Half the width of a curve's area, as a part of the tolerance: by default it is as wide as a mean edge,
#: as fine as the mesh. With 0.25 and 1 mean moment arms change by up to 0.2 mm (root mean square) for curves
#: on two muscles of a hip, by 1.0 and 2.2 mm for loose points on six muscles of a knee.
HALF_WIDTH = 0.5


class Patch(NamedTuple):
    """Attachment area on a muscle.

    A ring encloses points (k,), ascending. For a curve they are the points within the tolerance; segments
    (j, 3) are the curve's, triangles without area, of point ids, and the area is the surface within a
    distance of the segments [mm]: see :func:`band_along`.
    """

    points: Ints
    segments: Ints = np.empty((0, 3), dtype=np.int64)
    within: float = 0.0


def attachment_patch(
    points: Floats, triangles: Ints, landmarks: Floats, closed: bool, *, tolerance: float | None = None,
    bone_distance: FloatMap | None = None,
) -> Patch:  # fmt: skip
    """Return an attachment area on a muscle.

    Landmarks are projected to the nearest points of the muscle, on the side that faces the bone if within
    reach, and geodesics along edges join neighbours. A ring cuts the surface: the patch is the cut-off parts
    except the largest, with the ring's points, so a ring that crosses itself keeps all its loops, in either
    direction. Among parts of similar size, the part nearer to the bone is the patch. An open curve, a ring on
    a line, and a ring that cuts nothing off give the points within a tolerance of the projected curve, on its
    side of the muscle.

    points, triangles : (n, 3), (m, 3), the muscle [mm];
    landmarks : (k, 3), k >= 1, in boundary order [mm], on or off the muscle;
    closed : true for a ring of landmarks;
    tolerance : largest distance of a point from the projected curve, for curves [mm]. Default: the mean edge
        length;
    bone_distance : callable, from points (j, 3) to distances (j,) from the bone, negative inside; by default
        landmarks go to either side of the muscle, and the smaller side of a ring is its inside.

    Raises a ValueError if a landmark is too far from the muscle, or neighbours are on unconnected parts.
    """
    edges, edge_of = surfaces.numbered_edges(triangles)
    usual = float(surfaces.edge_lengths(points, edges).mean())
    within = usual if tolerance is None else tolerance
    vertices = _nearest_vertices(points, triangles, landmarks, (within, usual), bone_distance)
    spread = np.linalg.svd(landmarks - landmarks.mean(axis=0), compute_uv=False)
    ring = closed and len(landmarks) > 2 and bool(spread[1] > SLIVER * spread[0])
    curve = geodesic_curve(points, edges, vertices, closed=ring)
    if ring and len(patch := _enclosed(points, triangles, curve, (edges, edge_of), bone_distance)):
        return Patch(patch)
    # Points connected with the curve: the opposite face may be as near.
    segments = np.column_stack([curve, np.append(curve[1:], curve[-1]), curve])  # triangles without area
    on_patch = triangle_tree(points, segments).nearest(points)[2] <= within
    on_patch[curve] = True
    labels = surfaces.point_components(len(points), edges[on_patch[edges].all(axis=1)])
    return Patch(np.flatnonzero(on_patch & np.isin(labels, labels[curve])), segments, HALF_WIDTH * within)


def _nearest_vertices(
    points: Floats, triangles: Ints, landmarks: Floats, lengths: tuple[float, float], to_bone: FloatMap | None
) -> Ints:
    """Return the nearest used point of each landmark.

    Landmarks off a thin muscle, or in it, may be nearer to the face away from the bone. So points that face
    the bone are preferred, unless all landmarks are points already. The lengths are the tolerance and the
    muscle's mean edge.
    """
    used = np.flatnonzero(np.bincount(triangles.reshape(-1)))
    tree = cKDTree(points[used])
    offsets, nearest = tree.query(landmarks)
    size = diagonal(points[used])
    limit = max(FARTHEST * size, lengths[0])
    worst = int(np.argmax(offsets))
    if offsets[worst] > limit:
        problem = f"landmark {worst} is {offsets[worst]:.4g} from the muscle, of size {size:.4g}"
        remedy = "check the units, leave out an attachment of another muscle, or give a larger distance"
        raise InputError("", f"{problem}; at most {limit:.4g} is accepted", remedy)
    if to_bone is not None and offsets[worst] > SAME * size:
        side = np.sign(surfaces.signed_volume(points, triangles) or 1.0)
        outward = vertex_normals(points, triangles) * side
        waiting, count, step = np.arange(len(landmarks)), 1, lengths[1]
        while len(waiting):
            offsets, candidates = tree.query(landmarks[waiting], [*range(count // 2 + 1, count + 1)])
            ids = used[np.minimum(candidates, len(used) - 1)].ravel()
            # Landmarks nearest to the rim stay there, but no landmark moves there.
            least = -FACING if count == 1 else FACING
            approach = to_bone(points[ids]) - to_bone(points[ids] + step * outward[ids])
            facing = ((approach / step).reshape(candidates.shape) >= least) & (offsets <= limit)
            settled = facing.any(axis=1)
            nearest[waiting[settled]] = candidates[settled, facing[settled].argmax(axis=1)]
            waiting = waiting[~settled & (offsets[:, -1] <= limit)]
            count *= 2
    vertices: Ints = used[nearest].astype(np.int64)
    return np.asarray(vertices[np.append(True, vertices[1:] != vertices[:-1])])


def _enclosed(
    points: Floats, triangles: Ints, loop: Ints, numbered: tuple[Ints, Ints], to_bone: FloatMap | None
) -> Ints:
    """Return the points inside a closed loop of edges.

    Triangles are flooded across all edges except the loop's. The largest part at the loop is the outside. The
    loop may be any: geodesics may share edges, touch and cross.
    """
    edges, edge_of = numbered
    of_loop = np.column_stack([loop[:-1], loop[1:]])
    cut = np.isin(*(np.sort(each, axis=1) @ np.array([len(points), 1]) for each in (edges, of_loop)))
    order = np.argsort(edge_of, kind="stable")
    owners, number = order // 3, edge_of[order]  # the triangle and the edge of each half-edge
    joined = (number[1:] == number[:-1]) & ~cut[number[1:]]
    labels = surfaces.point_components(len(triangles), np.column_stack([owners[:-1], owners[1:]])[joined])
    at_loop = np.unique(labels[owners[cut[number]]])
    if len(at_loop) < 2:
        return np.zeros(0, dtype=np.int64)
    areas = np.linalg.norm(triangle_normals(points, triangles), axis=1) / 2.0
    largest = at_loop[np.argmax(np.bincount(labels, weights=areas)[at_loop])]
    inside = np.isin(labels, at_loop) & (labels != largest)
    outside = labels == largest
    share = areas[inside].sum() / (areas[inside].sum() + areas[outside].sum())
    # A flat muscle may be attached with a whole face, and area does not tell its faces apart. (Nor does the
    # plane of the ring: over a hollow bone the wrong face is nearer.)
    if to_bone is not None and share > CLEAR_SHARE:
        distances = to_bone(points[triangles].mean(axis=1))
        nearness = [np.average(distances[part], weights=areas[part]) for part in (inside, outside)]
        if nearness[1] < nearness[0]:
            inside = outside
    return np.union1d(triangles[inside], loop)


def discs_over(rings: Sequence[Floats]) -> tuple[Floats, Ints]:
    """Return points and triangles that span rings (k, 3).

    Triangles go from each ring's mean to its sides. On a coarse mesh the triangles between attached points
    leave out up to an edge's length along the rim of an area, and an aponeurosis within a muscle has only its
    ring. Rings of fewer than three points span nothing.
    """
    points, triangles = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)]
    for ring in (ring for ring in rings if len(ring) > 2):
        number = sum(map(len, points)) + np.arange(len(ring))
        triangles.append(np.column_stack([number, np.roll(number, -1), np.full(len(ring), number[-1] + 1)]))
        points += [ring, ring.mean(axis=0)[None]]
    return np.vstack(points), np.vstack(triangles).astype(np.int64)


#: Distance of a small triangle's corners from its middle, as a part of half the width of a band. With 0.06
#: and 0.12 mean lengths of fibres in ten muscles of a hip and a knee differ by at most 0.3 mm, with 0.5 by
#: 0.9.
FINE = 0.25
#: Most landmarks of an outline: patches inside outlines have 0.9 to 1.0 of the original area.
MOST_LANDMARKS = 40


def outline(points: Floats, triangles: Ints, patch: Ints) -> tuple[Floats, bool]:
    """Return a patch's boundary points, and True for a ring. Points (j, 3), connected patch (k,).

    Holes are left out. A patch without a triangle is no ring: its points are returned in order.
    """
    edges = surfaces.half_edges(triangles)
    within = np.isin(edges, patch).all(axis=1)
    inside = {(b, a) for a, b in edges[np.repeat(within.reshape(-1, 3).all(axis=1), 3)].tolist()}
    following: dict[int, list[int]] = {}
    for a, b in sorted({(a, b) for a, b in edges[within].tolist()} - inside):  # both ways between islands
        following.setdefault(a, []).append(b)
    if not inside:
        spread = points[patch] - points[patch].mean(axis=0)
        along = spread @ np.linalg.svd(spread, full_matrices=False)[2][0]
        return points[patch[np.argsort(along, kind="stable")]], False
    rings = []
    for start in following:  # Hierholzer 1873, doi:10.1007/BF01442866: once along each edge
        path, ring = [start], []
        while path:
            if following.get(path[-1]):
                path.append(following[path[-1]].pop())
            else:
                ring.append(path.pop())
        rings.append(ring)
    longest = max(rings, key=len)
    return points[longest[: -1 : -(-(len(longest) - 1) // MOST_LANDMARKS)]], True


def band_along(points: Floats, triangles: Ints, curves: Sequence[Patch]) -> tuple[Floats, Ints]:
    """Return points and triangles of the area of curves.

    The parts of the triangles within the distance of the segments: a band of even width, through triangles of
    any size. Triangles are cut in four until each is inside, outside or small.
    """
    near = np.concatenate([curve.points for curve in curves])
    tree = triangle_tree(points, np.vstack([curve.segments for curve in curves]))
    within, kept = max(curve.within for curve in curves), [np.empty((0, 3, 3))]
    corners = points[triangles[np.isin(triangles, near).any(axis=1)]]
    while len(corners):
        middles = corners.mean(axis=1)
        sizes = np.linalg.norm(corners - middles[:, None], axis=2).max(axis=1)
        away, small = tree.nearest(middles)[2], sizes <= FINE * within
        done = np.where(small, away, away + sizes) <= within
        kept.append(corners[done])
        corners = corners[~done & ~small & (away - sizes < within)]
        halves = 0.5 * (corners + np.roll(corners, -1, axis=1))
        at_corners = [np.stack([corners[:, i], halves[:, i], halves[:, i - 1]], axis=1) for i in range(3)]
        corners = np.concatenate([halves, *at_corners])
    parts = np.concatenate(kept)
    return parts.reshape(-1, 3), np.arange(3 * len(parts)).reshape(-1, 3)


def ring_sides(points: Floats) -> Floats:
    """Return the lengths (n,) of the sides of the ring through points (n, 3). The last closes the ring."""
    return np.asarray(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1))


def ring_area(points: Floats) -> float:
    """Return the area of the ring through points (n, 3). Seen from the direction of the largest area."""
    arms = points - points.mean(axis=0)
    return 0.5 * float(np.linalg.norm(np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)))


def short_ring(points: Floats) -> Ints:
    """Return an order (n,) of points with a short ring.

    Pairs of edges of the ring through the points are exchanged as long as the length falls (2-opt, Croes
    1958, doi:10.1287/opre.6.6.791).
    """
    distance, ring = np.linalg.norm(points[:, None] - points[None], axis=2), np.arange(len(points))
    while True:
        onward = np.roll(ring, -1)
        edges = distance[ring, onward]
        gain = edges[:, None] + edges[None] - distance[np.ix_(ring, ring)] - distance[np.ix_(onward, onward)]
        gain = np.triu(gain, 2)
        i, j = np.unravel_index(int(np.argmax(gain)), gain.shape)
        if not gain[i, j] > 1e-12 * edges.sum():
            return ring
        ring[i + 1 : j + 1] = ring[i + 1 : j + 1][::-1]
