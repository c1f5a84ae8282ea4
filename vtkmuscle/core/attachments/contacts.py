"""Estimated attachments of a muscle: its ends near bones.

The ends of a muscle are two points, near two bones, farthest apart along its surface. The points near a bone
at its end are the attachment.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.surface import NOISE, edge_lengths, point_components, unique_edges
from vtkmuscle.core.types import Bools, Floats, Ints

#: Muscle length that outweighs a gap of 1 between an end and a bone. Values from 1 to 100 choose the same
#: bones for 31 muscles of phantoms, a hip, two knees and an arm; with 1 areas of a gluteus maximus overlap
#: digitised areas by 0.28 and 0.35 instead of 0.64 and 0.56.
GAP_WEIGHT = 5.0
#: Largest distance of an attached end from its bone, in multiples of the near distance: 10 mm, beyond which
#: digitised landmarks are not on their bone either.
FAR_END = 4.0
#: Part of a muscle's length beyond its attachment, as for a corner of a broad muscle (at most 5 % in the
#: muscles above); a belly without its tendon extends farther.
BEYOND = 0.1
#: Last part of the distance from the opposite attachment for a tendon's attachment. From 0.15 to 0.3 areas
#: overlap digitised areas equally (mean intersection over union 0.63 to 0.66).
TENDON_END = 0.25
REMEDY = "join a separate tendon to the muscle's surface, add a missing bone, or give landmarks"


class Span(NamedTuple):
    """Longest distance along a muscle between points near two bones.

    `tips` has the muscle's end point near each bone, `distances` (n,) its distances to all points along the
    surface [mm]; `score` is the length less the weighted gaps at both ends [mm].
    """

    tips: dict[str, int]
    distances: dict[str, Floats]
    score: float


class AttachedEnd(NamedTuple):
    """End of a muscle: its nearest bone, and contacts by size.

    Contacts are bones and connected points (k,) near them. The confidence is 1 - (score of the best span with
    this end on another bone) / (score of the chosen span): 0 if another bone is equally likely, 1 if no other
    bone is near.
    """

    bone: str
    contacts: list[tuple[str, Ints]]
    confidence: float


def attached_ends(
    points: Floats, triangles: Ints, distances: Mapping[str, Floats], *, within: float,
    between: Sequence[str] = (), bodies: Sequence[Sequence[str]] = (),
) -> tuple[AttachedEnd, AttachedEnd]:  # fmt: skip
    """Return the likely attachments at both ends, the larger first.

    Each pair of bones has a span, and the longest is the muscle's: a passed bone has a shorter span. The
    points near a bone, within a distance or inside, belong to the end nearer along the surface. All count at
    the end with more points, as muscles arise from broad areas; at the opposite end only the points in the
    last quarter of the distance count, as muscles insert by tendons. Bones that move with the chosen bone
    count in the last quarter as well, if the muscle's end is near them.

    points, triangles : (n, 3), (m, 3), the muscle [mm]; point ids;
    distances : mapping of str to (n,), distance of each point from each bone, negative inside [mm];
    within : distance within which a point is near a bone, > 0 [mm]; at least half an edge, plus the gap of
        the end;
    between : sequence of str, bones of attachment, if given: up to two;
    bodies : sequence of sequence of str, groups of bones that move together.

    Raises a ValueError if fewer than two bones are near, or the muscle connects no two or ends far from them.
    """
    edges = unique_edges(triangles)
    lengths = edge_lengths(points, edges)
    graph = coo_array((lengths, tuple(edges.T)), shape=(len(points), len(points))).tocsr()
    used = np.bincount(triangles.ravel(), minlength=len(points)) > 0
    gaps = {bone: np.where(used, np.maximum(gap, 0.0), np.inf) for bone, gap in distances.items()}
    spans = _spans(graph, gaps, FAR_END * within, between)
    best = spans[0]
    if not best.score > 0.0:
        tips = " and ".join(map(repr, best.tips))
        raise InputError("", f"no connected part of the muscle is near {tips}", REMEDY)
    weights = np.linalg.norm(triangle_normals(points, triangles), axis=1) / 6.0
    weights = np.bincount(triangles.ravel(), np.repeat(weights, 3), len(points))
    reach, attached = max(within, 0.5 * float(lengths.mean())), {}
    for bone, opposite in permutations(best.tips):
        _check_end(points, best, bone, opposite, gaps, FAR_END * within)
        touched = gaps[bone] <= gaps[bone][best.tips[bone]] + reach
        attached[bone] = touched & (best.distances[bone] <= best.distances[opposite])
    broad, narrow = sorted(attached, key=lambda bone: -float(weights[attached[bone]].sum()))
    attached[narrow] &= _outer(_surface_distances(graph, np.flatnonzero(attached[broad])), attached[narrow])
    ends = []
    for own, opposite in ((broad, narrow), (narrow, broad)):
        rivals = {bone: span for span in spans if opposite in span.tips for bone in {*span.tips} - {opposite}}
        group = next((body for body in bodies if own in body), (own,))
        body = [bone for bone in group if bone in rivals and gaps[bone][rivals[bone].tips[bone]] <= reach]
        body = [own, *(bone for bone in body if bone != own)]
        outer = _outer(best.distances[opposite], attached[own])
        claims = [attached[own], *(outer & (gaps[bone] <= reach) for bone in body[1:])]
        gap = [np.where(claim, gaps[bone], np.inf) for claim, bone in zip(claims, body, strict=True)]
        nearest = np.where(np.any(claims, axis=0), np.argmin(gap, axis=0), -1)
        far = best.tips[opposite]
        parts = [(bone, part) for n, bone in enumerate(body) for part in _parts(edges, nearest == n, far)]
        sizes = np.array([weights[part].sum() for _, part in parts])
        order = np.argsort(-sizes, kind="stable")
        contacts = [parts[i] for i in order if sizes[i] >= NOISE * sizes[order[0]]]
        rival = max((span.score for bone, span in rivals.items() if bone not in group), default=0.0)
        ends.append(AttachedEnd(own, contacts, 1.0 - max(0.0, rival) / best.score))
    return ends[0], ends[1]


def _spans(graph: csr_array, gaps: Mapping[str, Floats], far: float, between: Sequence[str]) -> list[Span]:
    """Return the spans between near bones, the best first."""
    least = {bone: float(gap.min()) for bone, gap in gaps.items()}
    for bone in between:
        if least[bone] > far:
            raise InputError("", f"the muscle comes no nearer to {bone!r} than {least[bone]:.3g}", REMEDY)
    in_reach = [bone for bone in least if least[bone] <= far]
    pairs = [pair for pair in combinations(in_reach, 2) if set(between) <= set(pair)]
    if not pairs:
        listed = ", ".join(f"{bone!r} ({least[bone]:.3g})" for bone in sorted(least, key=least.__getitem__))
        raise InputError("", f"the muscle is near fewer than two bones; distances: {listed}", REMEDY)
    return sorted((_span(graph, gaps, pair) for pair in pairs), key=lambda span: -span.score)


def _span(graph: csr_array, gaps: Mapping[str, Floats], bones: tuple[str, str]) -> Span:
    """Return the span between two bones, by alternating farthest points."""
    gap, opposite_gap = (gaps[bone] for bone in bones)
    first, score = int(np.argmin(gap)), -np.inf
    while True:
        from_first = _surface_distances(graph, first)
        second = int(np.argmax(from_first - GAP_WEIGHT * opposite_gap))
        from_second = _surface_distances(graph, second)
        length = float(from_first[second] - GAP_WEIGHT * (gap[first] + opposite_gap[second]))
        if length <= score:
            tips, distances = (first, second), (from_first, from_second)
            return Span(dict(zip(bones, tips, strict=True)), dict(zip(bones, distances, strict=True)), length)
        score, first = length, int(np.argmax(from_second - GAP_WEIGHT * gap))


def _check_end(
    points: Floats, span: Span, bone: str, opposite: str, gaps: Mapping[str, Floats], far: float
) -> None:
    """Raise a ValueError for an end far from bones."""
    tip, distance = span.tips[bone], span.distances[opposite]
    last = int(np.argmax(np.where(span.distances[bone] <= distance, distance, -np.inf)))
    beyond, nearest = float(distance[last] - distance[tip]), min(float(gap[last]) for gap in gaps.values())
    if beyond > BEYOND * distance[last] and nearest > far:
        past = f"extends {beyond:.3g} beyond the point nearest to {bone!r}, and "
    elif gaps[bone][tip] > far:
        past, last, nearest = "", tip, float(gaps[bone][tip])
    else:
        return
    where = ", ".join(f"{value:.4g}" for value in points[last])
    problem = f"the muscle {past}ends at ({where}), {nearest:.3g} from the nearest bone"
    raise InputError("", problem if past else f"{problem}, {bone!r}", REMEDY)


def _surface_distances(graph: csr_array, start: int | Ints) -> Floats:
    """Return distances along the surface from the nearest start. -inf for unconnected points."""
    distances = dijkstra(graph, directed=False, indices=start, min_only=True)
    return np.where(np.isfinite(distances), distances, -np.inf)


def _outer(distances: Floats, attached: Bools) -> Bools:
    """Return the points in the last part of the distance."""
    return np.asarray(distances >= (1.0 - TENDON_END) * distances[attached].max())


def _parts(edges: Ints, mask: Bools, far: int) -> Iterator[Ints]:
    """Yield connected parts, with points cut off from a far point."""
    labels = point_components(len(mask), edges[mask[edges].all(axis=1)])
    for label in np.unique(labels[mask]):
        rest = point_components(len(mask), edges[~(mask & (labels == label))[edges].any(axis=1)])
        yield np.intersect1d(edges, np.flatnonzero(rest != rest[far]))
