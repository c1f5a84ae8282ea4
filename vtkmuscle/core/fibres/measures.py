"""Measures of fibres that are published: curvature, lines of action, cross-sections, groups, arrangement."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.cluster.vq import kmeans2
from scipy.spatial import cKDTree

from vtkmuscle.core.mesh.normals import triangle_normals, unit_vectors
from vtkmuscle.core.mesh.polylines import evenly_spaced, inner_points, segment_distances, smooth_polylines
from vtkmuscle.core.types import Bools, Floats, Ints


def polyline_curvatures(points: Floats, offsets: Ints) -> tuple[Floats, Floats, Floats]:
    """Return the curvature of polylines: that of the circle through a point and its two neighbours [1/mm].

    It is given at each point (n,), 0 at ends and where neighbours coincide; as the mean of each line (k,),
    weighted by the lengths of the segments at the points; and as the largest of each line (k,).
    """
    i, firsts = inner_points(offsets), offsets[:-1]
    before, after = points[i] - points[i - 1], points[i + 1] - points[i]
    one, other, chord = (np.linalg.norm(way, axis=1) for way in (before, after, before + after))
    sines, sides = np.linalg.norm(np.cross(before, after), axis=1), one * other * chord
    curvature, weights = np.zeros((2, len(points)))
    # 4 area / product of the sides (Menger).
    curvature[i] = np.divide(2.0 * sines, sides, out=np.zeros(len(i)), where=sides > 0.0)
    weights[i] = one + other
    total = np.add.reduceat(weights, firsts)
    mean = np.add.reduceat(weights * curvature, firsts)
    mean = np.divide(mean, total, out=np.zeros(len(total)), where=total > 0.0)
    return curvature, mean, np.maximum.reduceat(curvature, firsts)


def centroid_path(points: Floats, offsets: Ints, count: int) -> Floats:
    """Return the mean (count, 3) of all polylines at equal parts of their lengths, from start to end [mm]."""
    mean: Floats = evenly_spaced(points, offsets, count).mean(axis=0)
    return mean


def line_of_action(points: Floats, offsets: Ints) -> Floats:
    """Return the unit vector (3,) from the mean start of polylines to their mean end; 0 if these coincide."""
    vector = points[offsets[1:] - 1].mean(axis=0) - points[offsets[:-1]].mean(axis=0)
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else np.zeros(3)


def angles_to(points: Floats, offsets: Ints, direction: Floats) -> Floats:
    """Return the angle between each polyline's chord and a direction (3,), (k,) [degrees, 0 to 180]."""
    chords = points[offsets[1:] - 1] - points[offsets[:-1]]
    across = np.linalg.norm(np.cross(chords, direction), axis=1)
    angles: Floats = np.degrees(np.arctan2(across, chords @ direction))
    return angles


def have_area(points: Floats, triangles: Ints) -> Bools:
    """Return which triangles (m, 3) between points (n, 3) have an area, (m,)."""
    result: Bools = (triangle_normals(points, triangles) ** 2).sum(axis=1) > 0.0
    return result


def physiological_cross_section(volume: float, lengths: Floats, angles: Floats) -> tuple[float, float]:
    """Return the physiological cross-sectional area, and its part along the line of action [mm^2].

    The area is volume / mean fibre length; its part along the line of action is its product with the mean
    cosine of the fibres' angles to that line (Lieber, Friden 2000,
    doi:10.1002/1097-4598(200011)23:11<1647::AID-MUS1>3.0.CO;2-M). The volume is the muscle's [mm^3], lengths
    [mm] and angles to the line of action [degrees] are those of the fibres, (k,).
    """
    area = abs(volume) / float(lengths.mean())
    return area, area * float(np.cos(np.radians(angles)).mean())


def section_areas(points: Floats, triangles: Ints, places: Floats, normals: Floats) -> Floats:
    """Return the areas (s,) of sections of a closed surface by planes through places (s, 3) [mm^2].

    The surface faces outward; the planes have the unit normals (s, 3).
    """
    return np.array([_section_area(points, triangles, *plane) for plane in zip(places, normals, strict=True)])


def _section_area(points: Floats, triangles: Ints, place: Floats, normal: Floats) -> float:
    """Return half the sum of n . (a x b) over the segments from a to b in which triangles meet the plane."""
    about = points - place
    heights = about @ normal
    below = heights < 0.0
    a, b, c = below.take(triangles.T)
    met = triangles[(a != b) | (b != c)]
    ends = []
    for upward in (False, True):  # the edge on which the triangle's boundary goes up: so all loops run alike
        leaves = (below[met] == upward) & (below[np.roll(met, -1, axis=1)] != upward)
        side, row = leaves.argmax(axis=1), np.arange(len(met))
        i, j = met[row, side], met[row, (side + 1) % 3]
        share = heights[i] / (heights[i] - heights[j])
        ends.append(about[i] + share[:, None] * (about[j] - about[i]))
    return abs(float((np.cross(*ends) @ normal).sum())) / 2.0


def plane_crossings(points: Floats, offsets: Ints, place: Floats, normal: Floats) -> int:
    """Return the number of polylines that cross a plane, given by a point in it and its normal (3,)."""
    below = (points - place) @ normal < 0.0
    some, all_ = np.logical_or.reduceat(below, offsets[:-1]), np.logical_and.reduceat(below, offsets[:-1])
    return int((some & ~all_).sum())


def smoothed_curve(values: Floats, *, passes: int = 5) -> Floats:
    """Return curves over time without their noise: l'_i = (l_{i-1} + 4 l_i + l_{i+1}) / 6, ends kept.

    Kohout, Cervenka 2021, section 4.4, doi:10.1007/978-3-030-72379-8_24: five passes.

    Parameters
    ----------
    values : (f,) or (f, k) array
        A row per frame, for instance fibre lengths [mm].
    passes : int, optional
        Number of passes, >= 0.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.fibres.measures import smoothed_curve
    >>> smoothed_curve(np.array([0.0, 6.0, 0.0]), passes=1)
    array([0., 4., 0.])
    """
    return smooth_polylines(np.array(values, dtype=np.float64), np.array([0, len(values)]), 4.0, passes)


#: Neighbours that are looked at first, of which a fibre's own points are some.
_FIRST_NEIGHBOURS = 12


def filling_radius(volume: float, total_length: float) -> float:
    """Return the radius of tubes in hexagonal packing, whose cells of 2 sqrt(3) r^2 fill a volume [mm].

    The total length is that of all fibres, > 0 [mm].
    """
    return float(np.sqrt(volume / (2.0 * np.sqrt(3.0) * total_length)))


def room_between(points: Floats, offsets: Ints) -> Floats:
    """Return the distance (n,) of each point of polylines from the nearest other polyline.

    That is the distance to the segments on both sides of the nearest point of another line; infinite where
    there is one line only.
    """
    room = np.full(len(points), np.inf)
    if len(offsets) <= 2:
        return room
    line_of = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    nearest, tree = np.zeros(len(points), dtype=np.int64), cKDTree(points)
    waiting, count = np.arange(len(points)), _FIRST_NEIGHBOURS
    while len(waiting):
        count = min(count, len(points))
        found = tree.query(points[waiting], k=[*range(1, count + 1)])[1]
        foreign = line_of[found] != line_of[waiting, None]
        some = foreign.any(axis=1)
        nearest[waiting[some]] = found[some, foreign[some].argmax(axis=1)]
        waiting = waiting[~some]
        count *= 4
    for step in (-1, 1):
        other = np.clip(nearest + step, 0, len(points) - 1)
        other = np.where(line_of[other] == line_of[nearest], other, nearest)
        room = np.minimum(room, segment_distances(points, points[nearest], points[other]))
    return room


def group_fibres(lengths: Floats, count: int) -> Ints:
    """Return the group of each fibre (n,), from the lengths of all fibres in each pose (f, n).

    By k-means of the lengths' changes from their means over the poses: fibres of one group have the same
    moment arms, whatever their lengths are. There are fewer groups where fibres are fewer, or alike.
    """
    changes = (lengths - lengths.mean(axis=0)).T
    distinct = len(np.unique(changes.round(12), axis=0))
    count = max(1, min(count, distinct))
    if count == 1:
        return np.zeros(len(changes), dtype=np.int64)
    _, labels = kmeans2(changes, count, minit="++", rng=np.random.default_rng(0), missing="warn")
    # Groups are numbered by their first fibre, empty ones left out.
    _, first, plain = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return rank[plain].astype(np.int64)


def group_errors(lengths: Floats, groups: Ints) -> Floats:
    """Return the RMS difference (n,) of each fibre's change of length from that of its group."""
    changes = lengths - lengths.mean(axis=0)
    errors = np.zeros(lengths.shape[1])
    for group in range(int(groups.max()) + 1):
        mine = groups == group
        off = changes[:, mine] - changes[:, mine].mean(axis=1, keepdims=True)
        errors[mine] = np.sqrt((off**2).mean(axis=0))
    return errors


#: Places along each fibre at which neighbours are compared. The sides of neighbours at an end are compared
#: with those this many places farther in.
STATIONS, INWARD = 33, 4
#: Neighbours of each fibre, those nearest to it in the middle: the sides of a square.
NEIGHBOURS = 4
#: Neighbours nearer to each other than this part of the median distance at a place meet, and are on no side.
MEET = 0.25
#: Turn between two segments beyond which a fibre is hooked [degrees]: it runs back. Fibres turn by less onto
#: an area that lies beside them.
HOOKED = 90.0


@dataclass(frozen=True)
class Arrangement:
    """Measures of fibres at rest.

    `crossing` is the part of all neighbours that change sides in the last eighth of their way, at the worse
    of both ends; `hooked` the part of the fibres that turn by more than 90 degrees between two segments;
    `turning` the 95th percentile of the sum of turns along a fibre [degrees], 360 once round; `bare` the part
    of the muscle's volume that is farther from any fibre than neighbours are from each other in the belly
    (the median of their mean distance, where it is largest), 0 for fewer than five fibres.
    """

    crossing: float
    hooked: float
    turning: float
    bare: float


def arrangement(points: Floats, offsets: Ints, samples: Floats) -> Arrangement:
    """Return the arrangement of fibres in a muscle, of which samples (m, 3) of even density are given."""
    fibres = [points[a:b] for a, b in pairwise(offsets)]
    lines = evenly_spaced(points, offsets, STATIONS)
    turns = [_turns(np.diff(fibre, axis=0)) for fibre in fibres]
    near = _neighbours(lines[:, STATIONS // 2])
    away = cKDTree(lines.reshape(-1, 3)).query(samples)[0]
    return Arrangement(
        crossing=max(_crossing(lines, near), _crossing(lines[:, ::-1], near)),
        hooked=float(np.mean([turn.max(initial=0.0) > HOOKED for turn in turns])),
        turning=float(np.percentile([turn.sum() for turn in turns], 95.0)),
        bare=float((away > _spacing(lines, near)).mean()) if len(samples) else 0.0,
    )


def _turns(steps: Floats) -> Floats:
    """Return the angles between a line's steps (k, 3), (k - 1,) [degrees], without those of no length."""
    ahead = unit_vectors(steps[np.linalg.norm(steps, axis=1) > 0.0])
    cosines = (ahead[1:] * ahead[:-1]).sum(axis=1)
    angles: Floats = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    return angles


def _neighbours(middle: Floats) -> Ints:
    """Return the fibres nearest to each in the middle, (n, 4), or as many as there are."""
    count = min(NEIGHBOURS, len(middle) - 1)
    if count < 1:
        return np.empty((len(middle), 0), dtype=np.int64)
    near = cKDTree(middle).query(middle, count + 1)[1]
    # The fibre itself is among the nearest; where several are in one place, it need not be the first.
    return np.array([row[row != number][:count] for number, row in enumerate(near)])


def _spacing(lines: Floats, near: Ints) -> float:
    """Return the distance between neighbours in the belly; infinite where there are too few."""
    if near.shape[1] < NEIGHBOURS:
        return float("inf")
    apart = np.linalg.norm(lines[near] - lines[:, None], axis=-1)
    return float(np.median(apart.mean(axis=1), axis=0).max())


def _crossing(lines: Floats, near: Ints) -> float:
    """Return the part of neighbours that change sides between the first station and one farther in."""
    ahead = unit_vectors((lines[:, [1, INWARD + 1]] - lines[:, [0, INWARD]]).reshape(-1, 3)).reshape(-1, 2, 3)
    stations = lines[:, [0, INWARD]]
    sides = stations[near] - stations[:, None]
    sides -= (sides * ahead[:, None]).sum(axis=-1, keepdims=True) * ahead[:, None]
    apart = np.linalg.norm(sides, axis=-1)
    if not apart.size:
        return 0.0
    clear = (apart > MEET * np.median(apart, axis=(0, 1))).all(axis=-1)
    changed = (sides[:, :, 0] * sides[:, :, 1]).sum(axis=-1) < 0.0
    return float(changed[clear].mean()) if clear.any() else 0.0
