"""From the fitted template into a muscle along a harmonic function, which follows the muscle's course.

Kohout, Kukacka 2014, *Real-time modelling of fibrous muscle*, doi:10.1111/cgf.12354: the muscle is cut along
isolines of a function that is 0 on the origin area, 1 on the insertion area, and harmonic on the surface
between them. However the muscle bends, the isolines are across it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from hashlib import blake2b

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.harmonic import harmonic_extension, triangle_gradients
from vtkmuscle.core.mesh.normals import perpendiculars, triangle_normals
from vtkmuscle.core.mesh.solids import points_inside
from vtkmuscle.core.mesh.surface import faces_between
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, triangle_tree
from vtkmuscle.core.morphing.correspondence import (
    N_PLACES,
    LoopStack,
    cyclic_products,
    followed_starts,
    sampled_loop,
)
from vtkmuscle.core.morphing.sections import Branch, ClosedSurface
from vtkmuscle.core.morphing.slices import (
    GRAIN,
    SAME_HEIGHT,
    Box,
    Morph,
    SliceMaps,
    Slicing,
    guide_levels,
    shared_levels,
)
from vtkmuscle.core.types import Floats, Ints

#: Classes of the function's values in which its gradient is averaged.
N_CLASSES = 256
#: Isolines by which the muscle's main branch is found.
N_COURSE = 65
#: The first and the last isoline are this part of the muscle's length from the attachment areas: on their
#: rims they have many points in one place.
END_MARGIN = 1e-3
#: There is another branch where another isoline has more than this part of the main one's area.
OTHER_BRANCH = 0.05


def attachment_field(points: Floats, triangles: Ints, origin: Ints, insertion: Ints) -> Floats:
    """Return the function that is 0 on the origin area, 1 on the insertion area, harmonic between them.

    Points are (n, 3), triangles (m, 3), the areas ids of points (k,); the values (n,) are in [0, 1]. Raises a
    ValueError if a role has no points, the areas overlap, or no connected part of the muscle has both.
    """
    for role, area in (("origin", origin), ("insertion", insertion)):
        if not len(area):
            problem = f"no point of the muscle is in the {role} area, and the function needs both areas"
            raise InputError("", problem)
    both = np.intersect1d(origin, insertion)
    if len(both):
        raise InputError(
            "",
            f"the origin and the insertion area overlap: {len(both)} point(s) of the muscle are in both, the "
            f"first one {both[0]}, and no function is 0 and 1 there",
            "make one of the areas smaller",
        )
    known = np.concatenate([origin, insertion])
    values = np.repeat([0.0, 1.0], [len(origin), len(insertion)])
    extension = harmonic_extension(points, triangles, known, values[:, None])
    corners = extension[triangles, 0]
    if not (np.ptp(corners, axis=1) > 0.0).any():
        raise InputError("", "no connected part of the muscle has both an origin and an insertion area")
    return extension[:, 0]


def morph_by_isolines(
    fibre_points: Floats, transform: Floats, muscle: ClosedSurface, field: Floats, slicing: Slicing
) -> Morph:
    """Return fibre points moved from the fitted template into the muscle.

    A plane at a height of the template, as a part of its length, goes with the isoline that is that part of
    the way from the origin to the insertion, measured on the surface and averaged around it. Isolines are
    matched to the planes' rectangles such that neighbours twist least against each other and the sum of
    squared distances from the rectangles is least; where the muscle is bent away from the box's axis, these
    distances count less. Ends of fibres, at the bottom and the top of the template, go to the nearest places
    on the areas.

    Parameters
    ----------
    fibre_points, transform, muscle, slicing
        As for :func:`vtkmuscle.core.morphing.planes.morph_by_planes`.
    field : (n,) array
        From :func:`attachment_field`, of this muscle or of the same one in another pose.

    Raises
    ------
    ValueError
        If the function has no isolines with an inside.
    """
    box = Box(transform)
    inside = box.coordinates(fibre_points)
    of_field = blake2b(np.ascontiguousarray(field).data, digest_size=16).digest()
    course = slicing.once(
        ("isolines", of_field, slicing.key(transform)), lambda: _Course(box.surface(muscle), field)
    )
    slicing.report_progress(0.3)
    fractions = np.clip(inside[:, 2] / box.length, 0.0, 1.0)
    tolerance = max(slicing.slice_tolerance / box.length, SAME_HEIGHT)
    levels, slice_of = shared_levels(fractions, tolerance, GRAIN)
    levels = course.begin + levels * course.way
    slicing.report_progress(0.4)
    key = "mapped", of_field, slicing.key(transform, levels)
    mapped = slicing.once(key, lambda: _mapped(box, course, levels, slicing))
    heights = course.begin + fractions * course.way
    result, _, split_error = mapped.places(inside, heights, levels, slice_of)
    slicing.report_progress(1.0)
    at_origin, at_insertion = fractions <= SAME_HEIGHT, fractions >= 1.0 - SAME_HEIGHT
    between = result[~(at_origin | at_insertion)]
    n_outside = int((~points_inside(between, course.tree)).sum())
    for value, ends in ((0.0, at_origin), (1.0, at_insertion)):
        result[ends] = course.onto_area(value, result[ends])
    return Morph(box.positions(result), n_outside, split_error, course.share, 0.0)


class _Course:
    """A muscle in its box, with a function whose isolines follow it.

    The isolines at the `values` of the function are at the `ways` along the muscle, see
    :func:`way_of_values`. From `begin` on, for `way` [mm], the main branch is the only one; it has the part
    `share` of the muscle.
    """

    def __init__(self, surface: ClosedSurface, field: Floats) -> None:
        self.surface, self.field = surface, field
        self.values, self.ways = way_of_values(surface.points, surface.triangles, field)
        self.length = float(self.ways[-1])
        regular = self.length * np.linspace(END_MARGIN, 1.0 - END_MARGIN, N_COURSE)
        branch = self.branch(regular)
        first, last = _single_branch(branch)
        self.begin, self.way = regular[first], regular[last] - regular[first]
        self.share = float(branch.sizes[branch.numbers[branch.numbers >= 0]].sum() / branch.sizes.sum())

    def branch(self, at: Floats) -> Branch:
        """Return the main branch at some ways."""
        levels = np.interp(at, self.ways, self.values)
        for i in range(1, len(levels)):  # strictly ascending, even where rounding has made neighbours equal
            levels[i] = max(levels[i], np.nextafter(levels[i - 1], 2.0))
        return Branch(self.surface, self.field, levels, at, lambda areas: np.linalg.norm(areas, axis=1))

    @cached_property
    def tree(self) -> TriangleTree:
        """The muscle's triangles."""
        return triangle_tree(self.surface.points, self.surface.triangles)

    def onto_area(self, value: float, ends: Floats) -> Floats:
        """Return the places nearest to points (j, 3) on the area where the function has a value [mm]."""
        area = np.flatnonzero(self.field == value)
        faces = faces_between(self.surface.triangles, area)
        if not len(faces):
            faces = np.repeat(area[:, None], 3, axis=1)
        return triangle_tree(self.surface.points, faces).nearest(ends)[1]


def _mapped(box: Box, course: _Course, levels: Floats, slicing: Slicing) -> SliceMaps:
    """Return the isolines at some ways, matched to the template's rectangle."""
    guides = course.begin + guide_levels(course.way)
    branch = course.branch(np.union1d(levels, guides))

    def stack(at: Floats) -> tuple[LoopStack, Floats, Ints]:
        """Return the main branch's loops at some ways, their areas as vectors, and the ways that have one."""
        loops, hits = branch.loops_at(at)
        areas = branch.areas[branch.at(at[hits])]
        rings = [np.ascontiguousarray(loop) for loop in loops]
        return LoopStack(rings, at[hits], _distances_from_rectangle(box.sides, areas)), areas, hits

    rings, areas, hits = stack(levels)
    starts = followed_starts(rings, stack(guides)[0], slicing.continuity * course.length, np.zeros(3))
    views = np.array([_view_along(area) for area in areas])
    return SliceMaps(rings.loops, starts, hits, box.sides, slicing, views)


def way_of_values(points: Floats, triangles: Ints, field: Floats) -> tuple[Floats, Floats]:
    """Return the mean distance of the isolines of a function from its least value along the surface.

    ds/df is the length-weighted mean of 1 / |grad f| along an isoline. By the coarea formula that is the
    ratio of the area to the integral of |grad f| between neighbouring isolines. The function is (n,), in
    [0, 1], linear on each triangle; its values (k,) from 0 to 1 and the ways (k,) from 0 on [mm] ascend
    strictly.
    """
    areas, slopes = _per_class(points, triangles, field)
    steps = np.divide(areas, slopes, out=np.zeros(N_CLASSES), where=slopes > 0.0)
    # Without any triangle in a class: as steep as on the average.
    steps[slopes <= 0.0] = areas.sum() / slopes.sum()
    return np.linspace(0.0, 1.0, N_CLASSES + 1), np.append(0.0, np.cumsum(steps)) / N_CLASSES


def _per_class(points: Floats, triangles: Ints, field: Floats) -> tuple[Floats, Floats]:
    """Return the area in each class of values, and the integral of the gradient's size over it."""
    areas = np.linalg.norm(triangle_normals(points, triangles), axis=1) / 2.0
    slopes = areas * np.linalg.norm(triangle_gradients(points, triangles, field), axis=1)
    low, high = field[triangles].min(axis=1), field[triangles].max(axis=1)
    first = (low * N_CLASSES).astype(np.int64)
    last = np.minimum((high * N_CLASSES).astype(np.int64), N_CLASSES - 1)
    counts = np.where(slopes > 0.0, last - first + 1, 0)
    t = np.repeat(np.arange(len(triangles)), counts)
    k = first[t] + np.arange(len(t)) - np.repeat(np.cumsum(counts) - counts, counts)
    shares = (np.minimum(high[t], (k + 1) / N_CLASSES) - np.maximum(low[t], k / N_CLASSES)) / (high - low)[t]
    of_areas, of_slopes = (np.bincount(k, shares * sizes[t], N_CLASSES) for sizes in (areas, slopes))
    return of_areas.astype(np.float64), of_slopes.astype(np.float64)


def _single_branch(branch: Branch) -> tuple[int, int]:
    """Return the first and the last level between which the main branch is the only one.

    An origin of several areas has an isoline around each; they join on their way to the insertion.
    """
    sizes, numbers = branch.sizes, branch.numbers
    single = numbers >= 0
    for level in np.flatnonzero(single):
        others = [n for n in branch.sections.loops_of(int(level)) if n != numbers[level]]
        single[level] = not others or sizes[others].max() <= OTHER_BRANCH * sizes[numbers[level]]
    if not single.any():
        single = numbers >= 0
    # The longest run of levels with one branch.
    runs = np.flatnonzero(np.diff(single.astype(np.int64), prepend=0, append=0)).reshape(-1, 2)
    first, end = runs[np.diff(runs, axis=1)[:, 0].argmax()]
    return int(first), int(end) - 1


def _distances_from_rectangle(sides: Floats, areas: Floats) -> Callable[[Floats], Floats]:
    """Return the function from places (l, n, 3) of isolines to their costs (l, n) [mm^2].

    These are mean squared distances of an isoline from the rectangle, both about their centres, if it starts
    there; they count less where its vector area (3,) is inclined to z.
    """
    width, depth = sides[:2]
    corners = np.array([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)])
    rectangle = np.zeros((N_PLACES, 3))
    rectangle[:, :2] = sampled_loop(corners, np.zeros(2), N_PLACES) - [width / 2.0, depth / 2.0]
    along = areas[:, 2] / np.maximum(np.linalg.norm(areas, axis=1), np.finfo(float).tiny)

    def costs(places: Floats) -> Floats:
        centred = places - places.mean(axis=1, keepdims=True)
        squares = (centred**2).sum(axis=2).mean(axis=1) + (rectangle**2).sum(axis=1).mean()
        products = cyclic_products(np.broadcast_to(rectangle, centred.shape), centred)
        weights = np.maximum(along, 0.0) ** 2
        result: Floats = weights[:, None] * (squares[:, None] - 2.0 * products)
        return result

    return costs


def _view_along(area: Floats) -> Floats:
    """Return the frame, in rows, whose third axis is that of a vector area (3,), z for none."""
    length = float(np.linalg.norm(area))
    axis = area / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    return np.array([*perpendiculars(axis), axis])
