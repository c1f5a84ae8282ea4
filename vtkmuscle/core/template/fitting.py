"""Fit of the template's cube to a muscle's surface and attachments.

Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, section 3.2, extended in
doi:10.1007/978-3-642-38241-3_3.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.distance import cdist

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import perpendiculars
from vtkmuscle.core.mesh.polylines import proper_segments, segments
from vtkmuscle.core.mesh.sampling import skewed_direction
from vtkmuscle.core.mesh.surface import extent
from vtkmuscle.core.types import Floats, Ints

#: Costs equal within this difference tie, as a template's symmetries do; the first box counts.
TIE = 1e-9
#: Shortest edge of an outline, as a part of its length: shorter edges come from rounding.
SHORTEST_EDGE = 1e-6
#: Longest piece of a superficial fibre, as a part of the muscle's extent.
LONGEST_PIECE = 0.02


class BoxFit(NamedTuple):
    """Fitted box around a muscle.

    The `transform` (4, 4) from the unit cube is a right-handed rotation of a scaled cube, and a translation;
    the z axis runs from origin to insertion. `error` is the sum of distances from points of the template's
    areas to the nearest landmarks [mm], `angle` the turn about the axis from the first box of the sweep
    [degrees]. `cost`, least for the best box, is the mean distance as a part of the muscle's extent, plus the
    angle to superficial fibres [rad].
    """

    transform: Floats
    error: float
    angle: float
    cost: float


def areas_are_opposite(origin_area: Floats, insertion_area: Floats) -> bool:
    """Return True for areas at the bottom and the top.

    Areas are points (j, 3) in the unit cube. For aponeuroses on the sides the line between centroids differs
    from the cube's z axis.
    """
    across = insertion_area.mean(axis=0) - origin_area.mean(axis=0) - [0.0, 0.0, 1.0]
    return bool(np.abs(across).max() < 0.1)


def centroid_axis(origin: Floats, insertion: Floats) -> Floats:
    """Return the unit vector between the centroids, or raise a ValueError where these coincide."""
    difference: Floats = insertion.mean(axis=0) - origin.mean(axis=0)
    length = float(np.linalg.norm(difference))
    if not length > 1e-9 * float(np.ptp(np.vstack([origin, insertion]), axis=0).max()):
        problem = "the centroids of the origin and insertion landmarks coincide and give no axis"
        raise InputError("", problem, "set axis='principal'")
    return difference / length


def principal_axis(points: Floats, origin: Floats, insertion: Floats) -> Floats:
    """Return the principal axis of points, a unit vector (3,).

    The eigenvector of the covariance's largest eigenvalue, directed from the origin's to the insertion's
    centroid.
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
) -> BoxFit:
    """Return the box with areas nearest to the attachments.

    Boxes around an axis are turned about it by a full turn, step by step; each is the least box of its
    direction around all points. The first box with the least sum of distances is returned, from each point of
    the template's areas to the nearest landmark of the role. The paper starts from any two vectors across the
    axis; here the sweep starts from the least rectangle around the muscle seen along the axis, exact for a
    box-shaped muscle.

    points : (n, 3), points of the muscle's surface;
    axis : (3,), unit vector from origin to insertion;
    landmarks : (k, 3), (l, 3), landmarks of all origins, and of all insertions;
    areas : (i, 3), (j, 3), points of the template's origin and insertion areas in the unit cube;
    angle_step : step of the sweep [degrees];
    guide : callable, from a box (4, 4) to the angle between the template's and superficial fibres [rad],
        added to the mean distance as a part of the muscle's extent: a tenth of the muscle counts as 6
        degrees.

    Raises a ValueError if all points lie in one plane.
    """
    heights = points @ axis
    first, second = perpendiculars(axis)
    seen = np.column_stack([points @ first, points @ second])
    if not _has_area(seen) or not heights.max() > heights.min():
        raise InputError("", "the points of the muscle lie in one plane, so a box around them has no volume")
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
    for area, targets in zip(areas, landmarks, strict=True):
        inside = low[:, None] + area * extents[:, None]
        corners = np.einsum("kij,kaj->kai", frames, inside).reshape(-1, 3)
        errors += cdist(corners, targets).min(axis=1).reshape(len(turn), -1).sum(axis=1)
    boxes = np.tile(np.eye(4), (len(turn), 1, 1))
    boxes[:, :3, :3] = frames * extents[:, None]
    boxes[:, :3, 3] = np.einsum("kij,kj->ki", frames, low)
    costs = errors / (sum(map(len, areas)) * extent(points))
    if guide is not None:
        costs += [guide(box) for box in boxes]
    best = int((costs <= costs.min() + TIE).argmax())
    return BoxFit(boxes[best], float(errors[best]), float(steps[best]), float(costs[best]))


class SuperficialFibres(NamedTuple):
    """Short pieces of superficial fibres. Middles (m, 3) [mm], unit directions (m, 3), lengths (m,) [mm]."""

    middles: Floats
    directions: Floats
    lengths: Floats


def superficial_pieces(points: Floats, offsets: Ints, muscle: Floats) -> SuperficialFibres:
    """Return superficial fibres as short pieces.

    Points (n, 3) [mm]; first point of each fibre, and n. The longest piece is :data:`LONGEST_PIECE` of the
    extent of the muscle's points (m, 3).
    """
    a, b, lengths = proper_segments(points, offsets)
    counts = np.ceil(lengths / (LONGEST_PIECE * extent(muscle))).astype(np.int64)
    segment = np.repeat(np.arange(len(a)), counts)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    step, share = b - a, (within + 0.5) / counts[segment]
    middles = a[segment] + share[:, None] * step[segment]
    return SuperficialFibres(middles, (step / lengths[:, None])[segment], (lengths / counts)[segment])


def angle_to_nearest(seen: SuperficialFibres, points: Floats, offsets: Ints) -> float:
    """Return the angle between superficial and modelled fibres [rad].

    Root mean square over the pieces, weighted by length, to the nearest segments (0 to pi / 2).
    """
    a, b = segments(points, offsets)
    directions = (b - a)[cKDTree((a + b) / 2.0).query(seen.middles)[1]]
    across = np.linalg.norm(np.cross(seen.directions, directions), axis=-1)
    along = np.abs((seen.directions * directions).sum(axis=-1))
    angles = np.where((across > 0.0) | (along > 0.0), np.arctan2(across, along), np.pi / 2.0)
    return float(np.sqrt(np.average(angles**2, weights=seen.lengths)))


def _has_area(seen: Floats) -> bool:
    """Return False for collinear points, up to rounding."""
    centred = seen - seen.mean(axis=0)
    least, largest = np.linalg.eigvalsh(centred.T @ centred)
    return bool(least > 1e-14 * largest)


def _least_rectangle_angle(outline: Floats, marker: Floats) -> float:
    """Return a side angle [rad] of the least rectangle around a polygon.

    A side of the least rectangle lies along an edge of the convex polygon (Freeman, Shapira 1975,
    doi:10.1145/360881.360919). Among equal rectangles, as always for a rectangle, the side nearest to the
    marker's direction counts.
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
