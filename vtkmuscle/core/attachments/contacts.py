"""Estimated attachments of a muscle: at its ends, where it comes near bones.

A muscle's ends are the two points, one near each of two bones, that are farthest apart along its surface. The
points near a bone that lie at its end are its attachment.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.surface import edge_lengths, point_components, unique_edges
from vtkmuscle.core.types import Bools, Floats, Ints

#: Length of a muscle that outweighs a gap of 1 between its end and a bone. Anything from 1 to 100 chooses the
#: same bones for 31 muscles of phantoms, a hip, two knees and an arm.
GAP_WEIGHT = 5.0
#: An end farther from a bone than this many times the distance that counts as near is not attached to it: 10
#: mm, beyond which landmarks are not on their bone either.
FAR_END = 4.0
#: Part of a muscle's length that may lie beyond its attachment, as a corner of a broad muscle (at most 5 % in
#: the muscles above); a belly without its tendon goes on for more.
BEYOND = 0.1
#: Last part of the way from the other attachment that a tendon's attachment may take. From 0.15 to 0.3 areas
#: overlap digitised ones alike (mean intersection over union 0.63 to 0.65).
TENDON_END = 0.25
#: A contact smaller than this part of the largest one at the same end is noise.
LEAST_SHARE = 0.05

REMEDY = (
    "if its tendon is another surface, join both to one closed surface; if a bone is missing, add it; else "
    "give landmarks"
)


@dataclass(frozen=True, eq=False)
class Span:
    """The longest way along a muscle between points near two bones.

    `tips` has the muscle's point at the end near each bone, `ways` the distances (n,) of all points from it
    along the surface [mm]; `score` is the length of the way less the weighted gaps at its ends [mm].
    """

    tips: dict[str, int]
    ways: dict[str, Floats]
    score: float


@dataclass(frozen=True, eq=False)
class AttachedEnd:
    """One end of a muscle: the bone that it comes nearest to, and its contacts, the largest first.

    Contacts are bones and the connected points (k,) near them. Sureness is 1 - (score of the best span that
    has this end on another bone) / (score of the span taken): 0 where another bone is as likely, 1 where none
    is near.
    """

    bone: str
    contacts: list[tuple[str, Ints]]
    sureness: float


def attached_ends(
    points: Floats,
    triangles: Ints,
    distances: Mapping[str, Floats],
    *,
    within: float,
    between: Sequence[str] = (),
    bodies: Sequence[Sequence[str]] = (),
) -> tuple[AttachedEnd, AttachedEnd]:
    """Return the likely attachments of a muscle, at its two ends to two bones; that with more area first.

    Each pair of bones has a span, and the longest is the muscle's: a bone that the muscle passes is reached
    by a shorter one. The points near a bone, inside of it or within a distance, belong to the end that is
    nearer along the surface. At the end with more of them all count, for muscles arise from broad areas; at
    the other only those in the last quarter of the way from there, for they insert by tendons. Bones that
    move with the one taken count in the last quarter as well, if the muscle's farthest point is near them.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        The muscle [mm]; point ids.
    distances : mapping of str to (n,) array
        Per bone the distance of each point, negative inside [mm].
    within : float
        Up to which distance a point is near a bone, > 0 [mm]; half an edge where that is more, and as much
        farther as the end itself is from the bone.
    between : sequence of str
        Known bones of attachment: none, one or two.
    bodies : sequence of sequence of str
        Bones that move as one.

    Raises
    ------
    ValueError
        If fewer than two bones are near, the muscle reaches from none to another, or ends far from them.
    """
    edges = unique_edges(triangles)
    lengths = edge_lengths(points, edges)
    graph = coo_array((lengths, tuple(edges.T)), shape=(len(points), len(points))).tocsr()
    used = np.bincount(triangles.ravel(), minlength=len(points)) > 0
    gaps = {bone: np.where(used, np.maximum(away, 0.0), np.inf) for bone, away in distances.items()}
    spans = _spans(graph, gaps, FAR_END * within, between)
    best = spans[0]
    if not best.score > 0.0:
        raise InputError("", f"the muscle reaches nowhere from {' to '.join(map(repr, best.tips))}", REMEDY)
    weights = np.linalg.norm(triangle_normals(points, triangles), axis=1) / 6.0
    weights = np.bincount(triangles.ravel(), np.repeat(weights, 3), len(points))
    reach, near = max(within, 0.5 * float(lengths.mean())), {}
    for bone, other in permutations(best.tips):
        _check_end(points, best, bone, other, gaps, FAR_END * within)
        touched = gaps[bone] <= gaps[bone][best.tips[bone]] + reach
        near[bone] = touched & (best.ways[bone] <= best.ways[other])
    broad, narrow = sorted(near, key=lambda bone: -float(weights[near[bone]].sum()))
    near[narrow] &= _outer(_ways(graph, np.flatnonzero(near[broad])), near[narrow])
    ends = []
    for own, opposite in ((broad, narrow), (narrow, broad)):
        rivals = {bone: span for span in spans if opposite in span.tips for bone in {*span.tips} - {opposite}}
        group = next((body for body in bodies if own in body), (own,))
        body = [bone for bone in group if bone in rivals and gaps[bone][rivals[bone].tips[bone]] <= reach]
        body = [own, *(bone for bone in body if bone != own)]
        outer = _outer(best.ways[opposite], near[own])
        claims = [near[own], *(outer & (gaps[bone] <= reach) for bone in body[1:])]
        gap = [np.where(claim, gaps[bone], np.inf) for claim, bone in zip(claims, body, strict=True)]
        nearest = np.where(np.any(claims, axis=0), np.argmin(gap, axis=0), -1)
        far = best.tips[opposite]
        contacts = [(bone, part) for n, bone in enumerate(body) for part in _parts(edges, nearest == n, far)]
        contacts.sort(key=lambda one: -float(weights[one[1]].sum()))
        least = LEAST_SHARE * weights[contacts[0][1]].sum()
        kept = [one for one in contacts if weights[one[1]].sum() >= least]
        rival = max((span.score for bone, span in rivals.items() if bone not in group), default=0.0)
        ends.append(AttachedEnd(own, kept, 1.0 - max(0.0, rival) / best.score))
    return ends[0], ends[1]


def _spans(graph: csr_array, gaps: Mapping[str, Floats], far: float, between: Sequence[str]) -> list[Span]:
    """Return the spans between bones that the muscle comes near to, the best first."""
    least = {bone: float(gap.min()) for bone, gap in gaps.items()}
    for bone in between:
        if least[bone] > far:
            raise InputError("", f"the muscle comes no nearer to {bone!r} than {least[bone]:.3g}", REMEDY)
    near = [bone for bone in least if least[bone] <= far]
    pairs = [pair for pair in combinations(near, 2) if set(between) <= set(pair)]
    if not pairs:
        listed = ", ".join(f"{bone!r} ({least[bone]:.3g})" for bone in sorted(least, key=least.__getitem__))
        problem = f"a muscle is attached to two bones, but comes near to fewer; its distances are {listed}"
        raise InputError("", problem, REMEDY)
    return sorted((_span(graph, gaps, pair) for pair in pairs), key=lambda span: -span.score)


def _span(graph: csr_array, gaps: Mapping[str, Floats], bones: tuple[str, str]) -> Span:
    """Return the span between two bones, from the farthest point near one to that near the other."""
    one, other = (gaps[bone] for bone in bones)
    first, score = int(np.argmin(one)), -np.inf
    while True:
        from_first = _ways(graph, first)
        second = int(np.argmax(from_first - GAP_WEIGHT * other))
        from_second = _ways(graph, second)
        reached = float(from_first[second] - GAP_WEIGHT * (one[first] + other[second]))
        if reached <= score:
            tips, ways = (first, second), (from_first, from_second)
            return Span(dict(zip(bones, tips, strict=True)), dict(zip(bones, ways, strict=True)), reached)
        score, first = reached, int(np.argmax(from_second - GAP_WEIGHT * one))


def _check_end(
    points: Floats, span: Span, bone: str, other: str, gaps: Mapping[str, Floats], far: float
) -> None:
    """Raise a ValueError where the muscle ends far from the bones."""
    tip, way = span.tips[bone], span.ways[other]
    last = int(np.argmax(np.where(span.ways[bone] <= way, way, -np.inf)))
    beyond, nearest = float(way[last] - way[tip]), min(float(gap[last]) for gap in gaps.values())
    if beyond > BEYOND * way[last] and nearest > far:
        past = f"goes on for {beyond:.3g} beyond the place where it is near to {bone!r}, and "
    elif gaps[bone][tip] > far:
        past, last, nearest = "", tip, float(gaps[bone][tip])
    else:
        return
    where = ", ".join(f"{value:.4g}" for value in points[last])
    problem = f"the muscle {past}ends at ({where}), {nearest:.3g} from the nearest bone"
    raise InputError("", problem if past else f"{problem}, {bone!r}", REMEDY)


def _ways(graph: csr_array, start: int | Ints) -> Floats:
    """Return the distance of each point from the nearest start along the surface, -inf if there is no way."""
    ways = dijkstra(graph, directed=False, indices=start, min_only=True)
    return np.where(np.isfinite(ways), ways, -np.inf)


def _outer(way: Floats, near: Bools) -> Bools:
    """Return which points are in the last part of the way to the near ones."""
    outer: Bools = way >= (1.0 - TENDON_END) * way[near].max()
    return outer


def _parts(edges: Ints, mask: Bools, far: int) -> list[Ints]:
    """Return the connected parts of some points, each with all points that it cuts off from a far one."""
    labels = point_components(len(mask), edges[mask[edges].all(axis=1)])
    parts = []
    for label in np.unique(labels[mask]):
        part = mask & (labels == label)
        beside = point_components(len(mask), edges[~part[edges].any(axis=1)])
        parts.append(np.intersect1d(edges, np.flatnonzero(beside != beside[far])))
    return parts
