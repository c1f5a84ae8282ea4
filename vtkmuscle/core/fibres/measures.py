"""Published measures of fibres: curvature, lines of action, cross-sections, groups."""

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
    """Return curvatures of polylines [1/mm]. The circle passes a point and both neighbours.

    At each point (n,), 0 at ends and between coincident neighbours; mean of each line (k,), weighted by
    segment lengths; largest of each line (k,).
    """
    i, firsts = inner_points(offsets), offsets[:-1]
    before, after = points[i] - points[i - 1], points[i + 1] - points[i]
    a, b, chord = (np.linalg.norm(step, axis=1) for step in (before, after, before + after))
    sines, sides = np.linalg.norm(np.cross(before, after), axis=1), a * b * chord
    curvature, weights = np.zeros((2, len(points)))
    # 4 area / product of the sides (Menger).
    curvature[i] = np.divide(2.0 * sines, sides, out=np.zeros(len(i)), where=sides > 0.0)
    weights[i] = a + b
    total = np.add.reduceat(weights, firsts)
    mean = np.add.reduceat(weights * curvature, firsts)
    mean = np.divide(mean, total, out=np.zeros(len(total)), where=total > 0.0)
    return curvature, mean, np.maximum.reduceat(curvature, firsts)


def centroid_path(points: Floats, offsets: Ints, count: int) -> Floats:
    """Return the mean polyline (count, 3) [mm]. Means are at equal parts of the lines' lengths."""
    mean: Floats = evenly_spaced(points, offsets, count).mean(axis=0)
    return mean


def line_of_action(points: Floats, offsets: Ints) -> Floats:
    """Return the unit vector from mean start to mean end. It is 0 for coincident ends."""
    return unit_vectors(points[offsets[1:] - 1].mean(axis=0) - points[offsets[:-1]].mean(axis=0))


def angles_to(points: Floats, offsets: Ints, direction: Floats) -> Floats:
    """Return angles (k,) between chords and a direction (3,) [degrees]. From 0 to 180."""
    chords = points[offsets[1:] - 1] - points[offsets[:-1]]
    across = np.linalg.norm(np.cross(chords, direction), axis=1)
    angles: Floats = np.degrees(np.arctan2(across, chords @ direction))
    return angles


def have_area(points: Floats, triangles: Ints) -> Bools:
    """Return which triangles (m, 3) have an area, (m,)."""
    result: Bools = (triangle_normals(points, triangles) ** 2).sum(axis=1) > 0.0
    return result


def physiological_cross_section(volume: float, lengths: Floats, angles: Floats) -> tuple[float, float]:
    """Return the physiological cross-sectional area [mm^2]. Also its part along the line of action.

    The area is volume / mean fibre length; the part is the area times the mean cosine of the fibres' angles
    to the line of action (Lieber, Friden 2000, doi:10.1002/1097-4598(200011)23:11<1647::AID-MUS1>3.0.CO;2-M).
    Volume [mm^3] of the muscle; lengths [mm] and angles [degrees] of the fibres, (k,).
    """
    area = abs(volume) / float(lengths.mean())
    return area, area * float(np.cos(np.radians(angles)).mean())


def section_areas(points: Floats, triangles: Ints, centres: Floats, normals: Floats) -> Floats:
    """Return areas (s,) of plane sections [mm^2]. The surface is closed and faces outward.

    The planes have points (s, 3) and unit normals (s, 3).
    """
    planes = zip(centres, normals, strict=True)
    return np.array([_section_area(points, triangles, *plane) for plane in planes])


def _section_area(points: Floats, triangles: Ints, centre: Floats, normal: Floats) -> float:
    """Return half the sum of n . (a x b) over the section's segments from a to b."""
    about = points - centre
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


def plane_crossings(points: Floats, offsets: Ints, centre: Floats, normal: Floats) -> int:
    """Return the number of polylines that cross a plane. The plane has a point and a normal (3,)."""
    below = (points - centre) @ normal < 0.0
    partly, wholly = np.logical_or.reduceat(below, offsets[:-1]), np.logical_and.reduceat(below, offsets[:-1])
    return int((partly & ~wholly).sum())


def smoothed_curve(values: Floats, *, passes: int = 5) -> Floats:
    """Return curves over time, smoothed. l'_i = (l_{i-1} + 4 l_i + l_{i+1}) / 6, ends kept.

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


#: Neighbours in the first search, some of them on the fibre itself.
_FIRST_NEIGHBOURS = 12


def filling_radius(volume: float, total_length: float) -> float:
    """Return the radius [mm] of hexagonally packed tubes. The tubes fill the volume.

    A tube's cell has the area 2 sqrt(3) r^2. Volume [mm^3]; total length of all fibres, > 0 [mm].
    """
    return float(np.sqrt(volume / (2.0 * np.sqrt(3.0) * total_length)))


def room_between(points: Floats, offsets: Ints) -> Floats:
    """Return each point's distance (n,) from the nearest other polyline.

    Distances are to both segments at the nearest point of another line; infinite for a single line.
    """
    room = np.full(len(points), np.inf)
    if len(offsets) <= 2:
        return room
    line_of = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    nearest, tree = np.zeros(len(points), dtype=np.int64), cKDTree(points)
    waiting, count = np.arange(len(points)), _FIRST_NEIGHBOURS
    while len(waiting):
        count = min(count, len(points))
        neighbours = tree.query(points[waiting], k=[*range(1, count + 1)])[1]
        foreign = line_of[neighbours] != line_of[waiting, None]
        settled = foreign.any(axis=1)
        nearest[waiting[settled]] = neighbours[settled, foreign[settled].argmax(axis=1)]
        waiting = waiting[~settled]
        count *= 4
    for side in (-1, 1):
        adjacent = np.clip(nearest + side, 0, len(points) - 1)
        adjacent = np.where(line_of[adjacent] == line_of[nearest], adjacent, nearest)
        room = np.minimum(room, segment_distances(points, points[nearest], points[adjacent]))
    return room


def group_fibres(lengths: Floats, count: int) -> Ints:
    """Return the group of each fibre (n,). From fibre lengths in each pose (f, n).

    K-means of the changes of length about their means: fibres of a group have equal moment arms, whatever
    their lengths. Few or similar fibres give fewer groups.
    """
    changes = (lengths - lengths.mean(axis=0)).T
    distinct = len(np.unique(changes.round(12), axis=0))
    count = max(1, min(count, distinct))
    if count == 1:
        return np.zeros(len(changes), dtype=np.int64)
    _, labels = kmeans2(changes, count, minit="++", rng=np.random.default_rng(0), missing="warn")
    # Groups are numbered by their first fibre, without empty groups.
    _, first, plain = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    return rank[plain].astype(np.int64)


def group_errors(lengths: Floats, groups: Ints) -> Floats:
    """Return RMS deviations (n,) from the group's change of length."""
    changes = lengths - lengths.mean(axis=0)
    errors = np.zeros(lengths.shape[1])
    for group in range(int(groups.max()) + 1):
        members = groups == group
        deviations = changes[:, members] - changes[:, members].mean(axis=1, keepdims=True)
        errors[members] = np.sqrt((deviations**2).mean(axis=0))
    return errors


#: Stations along each fibre; number of stations from an end to the station compared with the end.
STATIONS, INWARD = 33, 4
#: Neighbours of each fibre, nearest in the middle: the sides of a square.
NEIGHBOURS = 4
#: Neighbours meet, without a side, below this part of the median distance at a station.
MEET = 0.25
#: Turn between two segments beyond which a fibre is hooked, as it runs back [degrees].
HOOKED = 90.0


@dataclass(frozen=True)
class Arrangement:
    """Measures of fibres at rest.

    `crossing` is the part of neighbours that change sides in the last eighth of their length, at the worse
    end. `hooked` is the part of fibres with a turn of more than 90 degrees between two segments. `turning` is
    the 95th percentile of the summed turns along a fibre [degrees]. `bare` is the part of the muscle's volume
    farther from any fibre than the largest median distance between neighbours; 0 for fewer than five fibres.
    """

    crossing: float
    hooked: float
    turning: float
    bare: float


def arrangement(points: Floats, offsets: Ints, samples: Floats) -> Arrangement:
    """Return the arrangement of fibres. Samples (m, 3) of the muscle have even density."""
    fibres = [points[a:b] for a, b in pairwise(offsets)]
    lines = evenly_spaced(points, offsets, STATIONS)
    turns = [_turns(np.diff(fibre, axis=0)) for fibre in fibres]
    near = _neighbours(lines[:, STATIONS // 2])
    distances = cKDTree(lines.reshape(-1, 3)).query(samples)[0]
    return Arrangement(
        crossing=max(_crossing(lines, near), _crossing(lines[:, ::-1], near)),
        hooked=float(np.mean([turn.max(initial=0.0) > HOOKED for turn in turns])),
        turning=float(np.percentile([turn.sum() for turn in turns], 95.0)),
        bare=float((distances > _spacing(lines, near)).mean()) if len(samples) else 0.0,
    )


def _turns(steps: Floats) -> Floats:
    """Return angles between steps (k, 3) of a line [degrees]. Without zero steps."""
    ahead = unit_vectors(steps[np.linalg.norm(steps, axis=1) > 0.0])
    cosines = (ahead[1:] * ahead[:-1]).sum(axis=1)
    angles: Floats = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
    return angles


def _neighbours(middle: Floats) -> Ints:
    """Return the four (or fewer) nearest fibres, (n, 4). Distances are in the middle."""
    count = min(NEIGHBOURS, len(middle) - 1)
    if count < 1:
        return np.empty((len(middle), 0), dtype=np.int64)
    near = cKDTree(middle).query(middle, count + 1)[1]
    # The fibre itself is among the nearest, though not always first among coincident fibres.
    return np.array([row[row != number][:count] for number, row in enumerate(near)])


def _spacing(lines: Floats, near: Ints) -> float:
    """Return the largest median distance between neighbours. Infinite for too few."""
    if near.shape[1] < NEIGHBOURS:
        return float("inf")
    apart = np.linalg.norm(lines[near] - lines[:, None], axis=-1)
    return float(np.median(apart.mean(axis=1), axis=0).max())


def _crossing(lines: Floats, near: Ints) -> float:
    """Return the part of neighbours that change sides. Between the first station and `INWARD`."""
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
