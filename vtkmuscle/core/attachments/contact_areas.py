"""Where a muscle touches its bones, and which of these places are likely to be its attachments."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.surface import edge_lengths, half_edges, point_components, unique_edges
from vtkmuscle.core.types import Bools, Floats, Ints

#: A contact smaller than this part of the largest one on the same bone is noise.
LEAST_SHARE = 0.05

#: Of the points that touch a bone, those belong to its attachment that are at least this part as far from
#: the other attachment as the farthest one. Over the nearer ones the muscle slides. The value was chosen on
#: the four muscles of the LHDL hip, on which the estimates are measured, too: elsewhere they may be worse.
SAME_END = 0.6

#: Landmarks of an outline: at least, at most, and mean edges between them.
FEWEST_LANDMARKS, MOST_LANDMARKS, EDGES_APART = 8, 40, 3.0


@dataclass(frozen=True, eq=False)
class ContactArea:
    """A connected part of a muscle's surface that touches a bone.

    Attributes
    ----------
    bone : int
        Index of the bone.
    points : (k,) int array
        Point ids of the muscle, ascending.
    area : float
        A third of the triangles around each point [mm^2].
    """

    bone: int
    points: Ints
    area: float


def contact_areas(points: Floats, triangles: Ints, touching: Sequence[Bools]) -> list[ContactArea]:
    """Return the connected contacts of a muscle with each bone, without those that are noise.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        The muscle [mm]; point ids.
    touching : sequence of (n,) bool arrays
        For each bone, the points that touch it.

    Returns
    -------
    list of ContactArea
        By bone, the largest first.
    """
    edges = unique_edges(triangles)
    thirds = np.repeat(np.linalg.norm(triangle_normals(points, triangles), axis=1) / 6.0, 3)
    weights = np.bincount(triangles.ravel(), thirds, len(points))
    found = []
    for bone, mask in enumerate(touching):
        labels = point_components(len(points), edges[mask[edges].all(axis=1)])
        parts = [np.flatnonzero(mask & (labels == label)) for label in np.unique(labels[mask])]
        areas = [ContactArea(bone, part, float(weights[part].sum())) for part in parts]
        areas.sort(key=lambda contact: -contact.area)
        found += [contact for contact in areas if contact.area >= LEAST_SHARE * areas[0].area]
    return found


@dataclass(frozen=True, eq=False)
class AttachedEnd:
    """One end of a muscle: its contacts with the bone that it is likely to be attached to.

    Attributes
    ----------
    contacts : list of ContactArea
        The largest first; all on one bone.
    sureness : float
        From 0, as likely on another bone, or as far from the muscle's end as can be, to 1.
    """

    contacts: list[ContactArea]
    sureness: float


def attached_ends(
    points: Floats, triangles: Ints, contacts: Sequence[ContactArea]
) -> tuple[AttachedEnd, AttachedEnd] | None:
    """Return the contacts that are likely to be attachments: those on one bone, and those on another.

    A muscle is attached at its ends, and slides over bones between: a bone beyond which the muscle touches
    another one at either end is passed over, however large the contact is. Of the others the two contacts, of
    different bones, are sought that are large and far from each other along the surface: with the largest
    product of that distance and the root of both areas. Of all contacts of these two bones what is far from
    the other one is kept.

    How sure an end is, is the product of two parts: 1 - the likelihood of the best pair that has this end on
    another bone, against that of the pair taken; and 1 - the part of the muscle's length that lies beyond it.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        The muscle [mm]; point ids.
    contacts : sequence of ContactArea
        From :func:`contact_areas`.

    Returns
    -------
    first, second : AttachedEnd
        That of the bone with the larger area first; None where fewer than two bones are touched.
    """
    edges = unique_edges(triangles)
    lengths = edge_lengths(points, edges)
    graph = coo_array((lengths, tuple(edges.T)), shape=(len(points), len(points))).tocsr()
    ways = [dijkstra(graph, directed=False, indices=contact.points, min_only=True) for contact in contacts]

    def apart(one: int, other: int) -> float:
        return float(ways[one][contacts[other].points].mean())

    def likelihood(pair: tuple[int, int]) -> float:
        one, other = pair
        return apart(*pair) * float(np.sqrt(contacts[one].area * contacts[other].area))

    numbers = range(len(contacts))
    pairs = [pair for pair in product(numbers, numbers) if contacts[pair[0]].bone < contacts[pair[1]].bone]
    if not pairs:
        return None
    along = _along(graph)
    passed = passed_over(along, contacts)
    best = max((pair for pair in pairs if not passed & {contacts[one].bone for one in pair}), key=likelihood)
    ends = []
    for chosen, opposite in (best, best[::-1]):
        bone = contacts[chosen].bone
        touching = np.zeros(len(points), dtype=np.bool_)
        for contact in contacts:
            touching[contact.points] |= contact.bone == bone
        far = ways[opposite] >= SAME_END * ways[opposite][contacts[chosen].points].max()
        masks = [touching & far if number == bone else np.zeros_like(far) for number in range(bone + 1)]
        kept = contact_areas(points, triangles, masks)
        others = [
            likelihood(pair)
            for pair in pairs
            if contacts[opposite].bone in {contacts[one].bone for one in pair}
            and bone not in {contacts[one].bone for one in pair}
        ]
        margin = max(0.0, 1.0 - max(others, default=0.0) / likelihood(best))
        at = along[np.concatenate([contact.points for contact in kept])]
        ends.append(AttachedEnd(kept, margin * (1.0 - float(min(at.min(), 1.0 - at.max())))))
    first, second = sorted(ends, key=lambda end: -sum(contact.area for contact in end.contacts))
    return first, second


def passed_over(along: Floats, contacts: Sequence[ContactArea]) -> set[int]:
    """Return the bones that a muscle passes: at either end it touches another one farther out.

    Parameters
    ----------
    along : (n,) array
        How far along the muscle each of its points is, from 0 to 1.
    contacts : sequence of ContactArea
        Of all bones.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.attachments.contact_areas import ContactArea, passed_over
    >>> ends = [ContactArea(bone, np.array([bone]), 9.0) for bone in range(3)]
    >>> passed_over(np.array([0.0, 0.7, 1.0]), ends)
    {1}
    """
    reach = {
        bone: np.concatenate([along[one.points] for one in contacts if one.bone == bone])
        for bone in {contact.bone for contact in contacts}
    }
    return {
        bone
        for bone, mine in reach.items()
        if any(other.min() < mine.min() for other in reach.values())
        and any(other.max() > mine.max() for other in reach.values())
        and len(reach) > 2
    }


def _along(graph: csr_array) -> Floats:
    """Return how far each point is from one end of the surface to the other, from 0 to 1, along it."""
    start = dijkstra(graph, directed=False, indices=0)
    one = int(np.argmax(np.where(np.isfinite(start), start, -1.0)))
    first = dijkstra(graph, directed=False, indices=one)
    first = np.where(np.isfinite(first), first, 0.0)
    second = dijkstra(graph, directed=False, indices=int(np.argmax(first)))
    second = np.where(np.isfinite(second), second, 0.0)
    return np.asarray(first / np.maximum(first + second, np.finfo(np.float64).tiny))


def outline(points: Floats, triangles: Ints, patch: Ints) -> tuple[Floats, bool]:
    """Return landmarks along the boundary of a patch of the muscle, in order.

    The patch has to be connected. Holes in it, and what hangs on it by one point only, are left out.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        The muscle [mm]; point ids.
    patch : (k,) int array
        Point ids.

    Returns
    -------
    landmarks : (j, 3) array
        [mm]
    closed : bool
        True for a ring; False where the patch has no triangle, and its points are the landmarks.
    """
    inside = np.isin(triangles, patch).all(axis=1)
    loops = _boundary_loops(triangles[inside])
    if not loops:
        spread = points[patch] - points[patch].mean(axis=0)
        along = spread @ np.linalg.svd(spread, full_matrices=False)[2][0]
        return points[patch[np.argsort(along, kind="stable")]], False
    steps = [np.linalg.norm(points[loop] - points[np.roll(loop, -1)], axis=1) for loop in loops]
    longest = int(np.argmax([step.sum() for step in steps]))
    ring, step = points[loops[longest]], steps[longest]
    spacing = EDGES_APART * float(step.mean())
    count = int(np.clip(round(step.sum() / spacing), FEWEST_LANDMARKS, MOST_LANDMARKS))
    # The boundary of a set of points is ragged: a mean over three points smooths it.
    ring = (np.roll(ring, 1, axis=0) + 2.0 * ring + np.roll(ring, -1, axis=0)) / 4.0
    closed = np.vstack([ring, ring[:1]])
    at = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1)))
    wanted = at[-1] * np.arange(count) / count
    return np.column_stack([np.interp(wanted, at, closed[:, k]) for k in range(3)]), True


def _boundary_loops(triangles: Ints) -> list[Ints]:
    """Return the loops of edges that belong to one triangle only, each once round."""
    directed = [(int(a), int(b)) for a, b in half_edges(triangles)]
    both = set(directed)
    following: dict[int, list[int]] = {}
    for a, b in directed:
        if (b, a) not in both:
            following.setdefault(a, []).append(b)
    loops = []
    for start, ends in following.items():
        while ends:
            path, at = [start], ends.pop()
            while True:
                if at in path:  # back at a point where two loops may touch: what is between is one of them
                    first = path.index(at)
                    loops.append(np.array(path[first:], dtype=np.int64))
                    del path[first + 1 :]
                else:
                    path.append(at)
                if not following.get(at):
                    break
                at = following[at].pop()
    return loops
