"""Fibre templates in the unit cube, and their fit to a muscle.

Fibres are Bezier curves with parameters (r, s) in [0, 1]^2. The k-th control point of a fibre lies on the
k-th *sheet* of a template, a bilinear patch with corners at (r, s) = (0, 0), (1, 0), (1, 1) and (0, 1). The
first sheet is the origin area, the last sheet the insertion area. Several parts of a template share the range
of r equally. The kinds are written out in ``templates.toml``:

``parallel``
    Straight fibres from the whole bottom (z = 0) to the whole top (z = 1).
``pennate``
    Straight, equally long, parallel fibres, oblique from the origin aponeurosis, the lower half of the face x
    = 0, to the insertion aponeurosis, the upper half of the face x = 1: from (0, s, r / 2) to (1, s, r / 2 +
    1 / 2). In a block of width w (x) and length l (z) fibres have the length sqrt(w^2 + (l / 2)^2), and the
    pennation angle atan(2 w / l) against the aponeuroses and the block's long axis. The areas lie side by
    side, so the line between them is no axis of the block.
``bipennate``
    Two pennate halves: from the lower half of the faces x = 0 (r < 1/2) and x = 1 to a tendon in the middle,
    the upper half of the plane x = 1 / 2. In a block the pennation angle is atan(w / l).
``curved``
    From the whole bottom to the whole top in arcs towards x = 1.
``fan``
    From the whole bottom to a narrow insertion area in the middle of the top.

A user's template is a small TOML or JSON file with the sheets from origin to insertion area::

    sheets = [  # a strap that bulges to the side: degree 2
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],              # the origin area
        [[0.3, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0.3, 1, 0.5]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],              # the insertion area
    ]

A template of several parts is a list of tables ``[[parts]]``, each with ``sheets`` of equal degree.

References
----------
Kohout, Clapworthy, Martelli, Viceconti 2012, *Muscle Fibres Modelling*, sections 3.1 and 3.2, extended in
doi:10.1007/978-3-642-38241-3_3; Blemker, Delp 2005, doi:10.1007/s10439-005-1433-7. Both show templates in
pictures only: the control points are this module's.
"""

import json
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from math import comb
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull, cKDTree
from scipy.spatial.distance import cdist

from vtkmuscle.core.errors import MOST_TEXT, InputError, check_is_file, fault_of
from vtkmuscle.core.mesh.normals import perpendiculars, unit_vectors
from vtkmuscle.core.mesh.polylines import proper_segments, segments
from vtkmuscle.core.mesh.sampling import skewed_direction, sobol
from vtkmuscle.core.mesh.surface import extent, longest_side
from vtkmuscle.core.types import ROUNDING, SAME, Floats, Ints

#: Degrees of the Bezier curves.
DEGREES = (2, 3, 4)


@dataclass(frozen=True, eq=False)
class FibreTemplate:
    """Fibres in the unit cube, as parts of control sheets.

    A part has corners (degree + 1, 4, 3). Part i of n has the fibres with i / n <= r < (i + 1) / n, and
    parametrises its sheets by (n r - i, s).
    """

    parts: tuple[Floats, ...]

    def areas(self, sheet: int) -> Floats:
        """Return the corners of the parts' areas, (n, 4, 3). Origin 0 or insertion -1."""
        return np.array([sheets[sheet] for sheets in self.parts])

    def fibres(self, r: ArrayLike, s: ArrayLike, t: ArrayLike) -> Floats:
        """Return points (n, m, 3) of fibres. They run from origin to insertion.

        Parameters r, s (n,) of the fibres and t (m,) of the points in [0, 1]; points are in the unit cube.
        """
        n_parts = len(self.parts)
        along = np.asarray(r, dtype=np.float64) * n_parts
        part = np.minimum(along.astype(np.int64), n_parts - 1)
        u, v = along - part, np.asarray(s, dtype=np.float64)
        weights = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=-1)
        polygons = np.einsum("nc,nkcd->nkd", weights, np.array(self.parts)[part])
        # Rounding must not lift a point out of the cube.
        return np.asarray(np.clip(bezier(polygons, t), 0.0, 1.0))


def bezier(polygons: Floats, t: ArrayLike) -> Floats:
    """Return points (n, m, 3) of Bezier curves.

    sum over k of C(d, k) (1 - t)^(d - k) t^k b_k for control points b (n, d + 1, 3) and parameters t (m,) in
    [0, 1].
    """
    degree = polygons.shape[1] - 1
    parameters = np.asarray(t, dtype=np.float64)
    basis = [comb(degree, k) * (1 - parameters) ** (degree - k) * parameters**k for k in range(degree + 1)]
    return np.asarray(np.einsum("km,nkd->nmd", np.array(basis), polygons))


def sobol_points(n: int) -> Floats:
    """Return evenly spread points (n, 2) inside the unit square.

    The first 2^m points of Sobol's sequence (Joe, Kuo 2008, doi:10.1137/070709359) have the multiples of
    2^-m, once each, as coordinates. A shift by half a cell keeps the first fibre off the cube's edge, which
    would lie in the muscle's surface.
    """
    return np.asarray(sobol(n, 2) + 0.5 / 2 ** max(n - 1, 0).bit_length())


def read_template(path: str | Path) -> FibreTemplate:
    """Return the template in a ``.toml`` or ``.json`` file.

    Raises a ValueError if the file cannot be read, is not TOML or JSON, or holds no template; the message
    names the key in the file and its allowed values.
    """
    file = Path(path)
    if file.suffix not in (".toml", ".json"):
        raise InputError("", f"the template {file} must be a .toml or a .json file")
    try:
        check_is_file(file, most=MOST_TEXT)
        text = file.read_text(encoding="utf-8")
        content = tomllib.loads(text) if file.suffix == ".toml" else json.loads(text)
    except (OSError, ValueError, RecursionError) as error:  # also an endless number, too many brackets
        (problem, remedy), kind = fault_of(error), file.suffix[1:].upper()
        raise InputError("", f"the template {file} cannot be read as {kind}: {problem}", remedy) from error
    return template_from(content, file)


def template_from(content: Any, where: str | Path) -> FibreTemplate:
    """Return the template in the content of a file.

    The content is a mapping with ``sheets``, or with ``parts``, a list of mappings with ``sheets``. A
    ValueError names the wrong key.
    """
    parts = content.get("parts", [content]) if isinstance(content, Mapping) else None
    if not isinstance(parts, list) or not parts:
        raise InputError(where, "there must be the key 'sheets', or the key 'parts' with a list of tables")
    template = []
    for number, table in enumerate(parts):
        key = f"parts[{number}]" if "parts" in content else "the template"
        if not isinstance(table, Mapping) or set(table) != {"sheets"}:
            raise InputError(where, f"{key} must be a table with the single key 'sheets'")
        template.append(_sheets(table["sheets"], where, key))
        if len(template[-1]) != len(template[0]):
            problem = f"parts[{number}] has {len(template[-1])} sheets and parts[0] {len(template[0])}"
            raise InputError(where, problem, "all parts must have the same number")
    return FibreTemplate(tuple(template))


def _sheets(value: Any, where: str | Path, key: str) -> Floats:
    """Return control sheets (degree + 1, 4, 3)."""
    least, most = DEGREES[0] + 1, DEGREES[-1] + 1
    try:
        sheets = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):  # no numbers, or lists of different lengths
        sheets = np.empty(0)
    if sheets.ndim != 3 or sheets.shape[1:] != (4, 3) or not least <= len(sheets) <= most:
        problem = f"{key}: sheets must be a list of {least} to {most} sheets, for Bezier curves of degree"
        problem += f" {DEGREES[0]} to {DEGREES[-1]}, each of 4 corners with three numbers"
        raise InputError(where, problem, "the corners are at (r, s) = (0, 0), (1, 0), (1, 1), (0, 1)")
    if not ((sheets >= 0.0) & (sheets <= 1.0)).all():
        raise InputError(where, f"{key}: corners must be points of the unit cube, from 0 to 1")
    for i, name in ((0, "origin"), (-1, "insertion")):
        first, second = sheets[i, 2] - sheets[i, 0], sheets[i, 3] - sheets[i, 1]
        if not np.linalg.norm(np.cross(first, second)) > 0.0:
            raise InputError(where, f"{key}: the corners of the {name} area enclose no area")
    if np.array_equal(sheets[0], sheets[-1]):
        raise InputError(where, f"{key}: the origin area and the insertion area are the same")
    return sheets


_KINDS = tomllib.loads((files("vtkmuscle.core") / "templates.toml").read_text(encoding="utf-8"))
#: The template of each kind.
TEMPLATES = {kind: template_from(content, "templates.toml") for kind, content in _KINDS.items()}
KINDS = tuple(TEMPLATES)
#: Longest piece of a superficial fibre, as a part of the muscle's extent: straight within 1e-4 of the extent,
#: in a bend with half of the extent as its radius.
LONGEST_PIECE = 0.02


class BoxFit(NamedTuple):
    """Fitted box around a muscle.

    The `transform` (4, 4) from the unit cube is a rotation of a scaled cube, mirrored where that is allowed,
    and a translation; the z axis runs from origin to insertion. `error` is the sum of distances from points
    of the template's areas to the nearest landmarks [mm]. `cost`, least for the best box, is the mean
    distance as a part of the muscle's extent, plus the angle to superficial fibres [rad].
    """

    transform: Floats
    error: float
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
    if not length > ROUNDING * longest_side(np.vstack([origin, insertion])):
        problem = "the centroids of the origin and insertion landmarks coincide and give no axis"
        raise InputError("", problem, "set axis='principal'")
    return difference / length


def principal_axis(points: Floats, origin: Floats, insertion: Floats) -> Floats:
    """Return the principal axis of points, a unit vector (3,).

    The eigenvector of the covariance's largest eigenvalue, from the origin's to the insertion's centroid.
    """
    axis: Floats = np.linalg.eigh(np.cov(points.T))[1][:, -1]
    return axis if axis @ (insertion.mean(axis=0) - origin.mean(axis=0)) >= 0.0 else -axis


def fit_box(
    points: Floats, axis: Floats, *, landmarks: tuple[Floats, Floats], areas: tuple[Floats, Floats],
    angle_step: float, guide: Callable[[Floats], float] | None = None, mirrors: bool = False,
) -> BoxFit:  # fmt: skip
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
        degrees;
    mirrors : whether the box may be left-handed, so that a mirrored muscle has the mirrored box.

    Raises a ValueError if all points lie in one plane.
    """
    heights = points @ axis
    first, second = perpendiculars(axis)
    seen = np.column_stack([points @ first, points @ second])
    least, largest = np.linalg.eigvalsh(np.cov(seen.T))
    if least <= 1e-14 * largest or not heights.max() > heights.min():
        raise InputError("", "the points of the muscle lie in one plane, so a box around them has no volume")
    x, y = seen[ConvexHull(seen).vertices].T[:, :, None]
    # The muscle's longer tail decides on the hand, as it does on the first side.
    first_turn, left = _least_rectangle_angle(np.column_stack([x, y]), skewed_direction(seen))
    hand = -1.0 if mirrors and left else 1.0
    turn = first_turn + hand * np.radians(np.arange(0.0, 360.0, angle_step))
    c, s = np.cos(turn), np.sin(turn)
    sides = x * c + y * s, hand * (y * c - x * s)
    ends = [
        np.column_stack([*(end(side, axis=0) for side in sides), np.full(len(turn), end(heights))])
        for end in (np.min, np.max)
    ]
    low, extents = ends[0], ends[1] - ends[0]
    across = np.outer(c, first) + np.outer(s, second), hand * (np.outer(c, second) - np.outer(s, first))
    frames = np.stack([*across, np.broadcast_to(axis, (len(turn), 3))], axis=2)

    errors = np.zeros(len(turn))
    for area, targets in zip(areas, landmarks, strict=True):
        corners = np.einsum("kij,kaj->kai", frames, low[:, None] + area * extents[:, None]).reshape(-1, 3)
        errors += cdist(corners, targets).min(axis=1).reshape(len(turn), -1).sum(axis=1)
    boxes = np.tile(np.eye(4), (len(turn), 1, 1))
    boxes[:, :3, :3] = frames * extents[:, None]
    boxes[:, :3, 3] = np.einsum("kij,kj->ki", frames, low)
    costs = errors / (sum(map(len, areas)) * extent(points))
    if guide is not None:
        costs += [guide(box) for box in boxes]
    # The first of costs that tie, as for a symmetric template.
    best = int((costs <= costs.min() + ROUNDING).argmax())
    return BoxFit(boxes[best], float(errors[best]), float(costs[best]))


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
    starts, step, lengths = proper_segments(points, offsets)
    counts = np.ceil(lengths / (LONGEST_PIECE * extent(muscle))).astype(np.int64)
    segment = np.repeat(np.arange(len(starts)), counts)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)
    middles = points[starts][segment] + ((within + 0.5) / counts[segment])[:, None] * step[segment]
    return SuperficialFibres(middles, (step / lengths[:, None])[segment], (lengths / counts)[segment])


def angle_to_nearest(seen: SuperficialFibres, points: Floats, offsets: Ints) -> float:
    """Return the angle between superficial and modelled fibres [rad].

    Root mean square over the pieces by length, to the nearest segments (0 to pi / 2).
    """
    a, b = segments(points, offsets)
    directions = (b - a)[cKDTree((a + b) / 2.0).query(seen.middles)[1]]
    across = np.linalg.norm(np.cross(seen.directions, directions), axis=-1)
    along = np.abs((seen.directions * directions).sum(axis=-1))
    angles = np.where((across > 0.0) | (along > 0.0), np.arctan2(across, along), np.pi / 2.0)
    return float(np.sqrt(np.average(angles**2, weights=seen.lengths)))


def _least_rectangle_angle(outline: Floats, marker: Floats) -> tuple[float, bool]:
    """Return a side angle [rad] of the least rectangle around a polygon, and if the marker is clockwise.

    A side of the least rectangle lies along an edge of the convex polygon (Freeman, Shapira 1975,
    doi:10.1145/360881.360919). Among equal rectangles, as always for a rectangle, the side nearest to the
    marker's direction counts.
    """
    edges = np.roll(outline, -1, axis=0) - outline
    lengths = np.linalg.norm(edges, axis=1)
    directions = unit_vectors(edges[lengths > SAME * lengths.sum()])
    sideways = np.column_stack([-directions[:, 1], directions[:, 0]])
    areas = np.ptp(outline @ directions.T, axis=0) * np.ptp(outline @ sideways.T, axis=0)
    least = areas <= areas.min() * (1.0 + ROUNDING)
    sides = np.vstack([directions[least], -directions[least], sideways[least], -sideways[least]])
    x, y = sides[int((sides @ marker).argmax())]
    return float(np.arctan2(y, x)), bool(x * marker[1] < y * marker[0])
