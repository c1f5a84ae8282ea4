"""Fitting the template's cube to a muscle: an oriented box around it, turned to suit its attachments.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.2,
extended in doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.distance import cdist

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import perpendiculars
from vtkmuscle.core.mesh.polylines import proper_segments, segments
from vtkmuscle.core.mesh.sampling import skewed_direction
from vtkmuscle.core.mesh.surface import extent
from vtkmuscle.core.types import Floats, Ints

#: Costs that differ by less than this are equal, and the first counts: a template's symmetries give ties.
TIE = 1e-9
#: Edges of an outline shorter than this part of it are rounding.
SHORTEST_EDGE = 1e-6
#: Segments of superficial fibres are cut in pieces of no more than this part of the muscle's extent.
LONGEST_PIECE = 0.02


@dataclass(frozen=True, eq=False)
class Fit:
    """A box around a muscle.

    Its `transform` (4, 4), unit cube to world, is a right-handed rotation of a cube scaled along its axes,
    and a translation; its z axis runs from origin to insertion. `error` is the sum of distances from the
    points of the template's areas to the nearest landmarks [mm], `angle` the turn about the axis from the
    first box of the sweep [degrees]. The best box has the least `cost`: the mean of these distances as a part
    of the muscle's extent, plus the angle to superficial fibres where there are some [rad].
    """

    transform: Floats
    error: float
    angle: float
    cost: float


def areas_are_opposite(origin_area: Floats, insertion_area: Floats) -> bool:
    """Return True where a template's areas, (j, 3) points in the unit cube, are its bottom and its top.

    Otherwise, as for aponeuroses on the sides, the line between their centroids is not the cube's z axis.
    """
    across = insertion_area.mean(axis=0) - origin_area.mean(axis=0) - [0.0, 0.0, 1.0]
    return bool(np.abs(across).max() < 0.1)


def centroid_axis(origin: Floats, insertion: Floats) -> Floats:
    """Return the unit vector from the centroid of the origin to that of the insertion.

    Raises a ValueError if the centroids coincide.
    """
    difference: Floats = insertion.mean(axis=0) - origin.mean(axis=0)
    length = float(np.linalg.norm(difference))
    if not length > 1e-9 * float(np.ptp(np.vstack([origin, insertion]), axis=0).max()):
        raise InputError(
            "",
            "the centroids of the origin and insertion landmarks coincide and give no axis",
            "set axis='principal'",
        )
    return difference / length


def principal_axis(points: Floats, origin: Floats, insertion: Floats) -> Floats:
    """Return the unit eigenvector of the points' covariance with the largest eigenvalue, (3,).

    Of its two directions, the one in which the insertion's centroid lies from the origin's.
    """
    centred = points - points.mean(axis=0)
    axis: Floats = np.linalg.eigh(centred.T @ centred)[1][:, -1]
    return axis if axis @ (insertion.mean(axis=0) - origin.mean(axis=0)) >= 0.0 else -axis


def fit_box(
    points: Floats,
    axis: Floats,
    *,
    landmarks: tuple[Floats, Floats],
    areas: tuple[Floats, Floats],
    angle_step: float,
    guide: Callable[[Floats], float] | None = None,
) -> Fit:
    """Return the box around a muscle whose areas lie nearest to the muscle's attachments.

    Boxes whose z axis is the given one are turned about it by a full turn, step by step; each is the least
    one that holds all points. For each point of the template's areas, put into the box, the nearest landmark
    of the same role is found; the first box with the least sum of these distances is returned. The paper
    starts from any two vectors across the axis: here they are the sides of the least rectangle around the
    muscle seen along the axis, so that a box-shaped muscle is met exactly.

    Parameters
    ----------
    points : (n, 3) array
        Points of the muscle's surface.
    axis : (3,) array
        Unit vector from origin to insertion.
    landmarks : (k, 3) array, (l, 3) array
        Of all origins, and of all insertions.
    areas : (i, 3) array, (j, 3) array
        Points of the template's origin and insertion areas in the unit cube.
    angle_step : float
        Degrees.
    guide : callable, optional
        From a box, unit cube to world (4, 4), to the angle between the template's fibres in it and those that
        were seen [rad]. It counts as much as the mean distance of the areas from the landmarks, as a part of
        the muscle's extent: a tenth of the muscle is as bad as 6 degrees.

    Raises
    ------
    ValueError
        If all points lie in one plane.
    """
    heights = points @ axis
    first, second = perpendiculars(axis)
    seen = np.column_stack([points @ first, points @ second])
    if not _has_area(seen) or not heights.max() > heights.min():
        raise InputError(
            "", "the points of the muscle lie in one plane, so that no box of any volume holds them"
        )
    x, y = seen[ConvexHull(seen).vertices].T[:, :, None]
    steps = np.arange(0.0, 360.0, angle_step)
    turn = _least_rectangle_angle(np.column_stack([x, y]), skewed_direction(seen)) + np.radians(steps)
    c, s = np.cos(turn), np.sin(turn)
    sides = x * c + y * s, y * c - x * s
    ends = [
        np.column_stack([*(end(side, axis=0) for side in sides), np.full(len(turn), end(heights))])
        for end in (np.min, np.max)
    ]
    low, extents = ends[0], ends[1] - ends[0]
    across = np.outer(c, first) + np.outer(s, second), np.outer(c, second) - np.outer(s, first)
    frames = np.stack([*across, np.broadcast_to(axis, (len(turn), 3))], axis=2)

    errors = np.zeros(len(turn))
    for area, nearby in zip(areas, landmarks, strict=True):
        inside = low[:, None] + area * extents[:, None]
        corners = np.einsum("kij,kaj->kai", frames, inside).reshape(-1, 3)
        errors += cdist(corners, nearby).min(axis=1).reshape(len(turn), -1).sum(axis=1)
    boxes = np.tile(np.eye(4), (len(turn), 1, 1))
    boxes[:, :3, :3] = frames * extents[:, None]
    boxes[:, :3, 3] = np.einsum("kij,kj->ki", frames, low)
    costs = errors / (sum(map(len, areas)) * extent(points))
    if guide is not None:
        costs += [guide(box) for box in boxes]
    best = int((costs <= costs.min() + TIE).argmax())
    return Fit(boxes[best], float(errors[best]), float(steps[best]), float(costs[best]))


@dataclass(frozen=True, eq=False)
class SuperficialFibres:
    """Short pieces of superficial fibres: middles (m, 3) [mm], unit directions (m, 3), lengths (m,) [mm]."""

    places: Floats
    directions: Floats
    weights: Floats


def superficial_pieces(points: Floats, offsets: Ints, muscle: Floats) -> SuperficialFibres:
    """Return superficial fibres as short pieces.

    Points are (n, 3) [mm], offsets the first point of each fibre, and n. No piece is longer than
    :data:`LONGEST_PIECE` of the extent of the muscle's points (m, 3).
    """
    a, b, lengths = proper_segments(points, offsets)
    counts = np.ceil(lengths / (LONGEST_PIECE * extent(muscle))).astype(np.int64)
    segment = np.repeat(np.arange(len(a)), counts)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = (within + 0.5) / counts[segment]
    step = b - a
    return SuperficialFibres(
        places=a[segment] + share[:, None] * step[segment],
        directions=(step / lengths[:, None])[segment],
        weights=(lengths / counts)[segment],
    )


def angle_to_nearest(seen: SuperficialFibres, points: Floats, offsets: Ints) -> float:
    """Return the angle between superficial fibres and the nearest segments of others, (0 to pi / 2) [rad].

    It is the root mean square, weighted by length. Points and offsets are those of the other fibres.
    """
    a, b = segments(points, offsets)
    directions = (b - a)[cKDTree((a + b) / 2.0).query(seen.places)[1]]
    across = np.linalg.norm(np.cross(seen.directions, directions), axis=-1)
    along = np.abs((seen.directions * directions).sum(axis=-1))
    angles = np.where((across > 0.0) | (along > 0.0), np.arctan2(across, along), np.pi / 2.0)
    return float(np.sqrt((seen.weights * angles**2).sum() / seen.weights.sum()))


def _has_area(seen: Floats) -> bool:
    """Return False for points on a line, up to rounding."""
    centred = seen - seen.mean(axis=0)
    least, largest = np.linalg.eigvalsh(centred.T @ centred)
    return bool(least > 1e-14 * largest)


def _least_rectangle_angle(outline: Floats, marker: Floats) -> float:
    """Return the angle of a side of the least rectangle around a convex polygon [rad].

    One side of that rectangle lies along an edge of the polygon (Freeman, Shapira 1975,
    doi:10.1145/360881.360919). Where several do equally well, as always for a rectangle, the side is taken
    that points most nearly along the marker.
    """
    edges = np.roll(outline, -1, axis=0) - outline
    lengths = np.linalg.norm(edges, axis=1)
    edges = edges[lengths > SHORTEST_EDGE * lengths.sum()]
    directions = edges / np.linalg.norm(edges, axis=1)[:, None]
    sideways = np.column_stack([-directions[:, 1], directions[:, 0]])
    areas = np.ptp(outline @ directions.T, axis=0) * np.ptp(outline @ sideways.T, axis=0)
    least = areas <= areas.min() * (1.0 + TIE)
    sides = np.vstack([directions[least], -directions[least], sideways[least], -sideways[least]])
    x, y = sides[int((sides @ marker).argmax())]
    return float(np.arctan2(y, x))
