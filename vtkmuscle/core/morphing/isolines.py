"""Template fibres into the muscle, along isolines.

Kohout, Kukacka 2014, *Real-time modelling of fibrous muscle*, doi:10.1111/cgf.12354: isolines of a function
that is 0 on the origin area, 1 on the insertion area, and harmonic on the surface between. However the muscle
bends, isolines cross the muscle.
"""

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.harmonic import harmonic_extension, triangle_gradients
from vtkmuscle.core.mesh.normals import perpendiculars, triangle_normals, unit_vectors
from vtkmuscle.core.mesh.sampling import PatchSamples
from vtkmuscle.core.mesh.surface import NOISE
from vtkmuscle.core.morphing import slices
from vtkmuscle.core.morphing.correspondence import N_STARTS, LoopStack, cyclic_products, sampled_loop
from vtkmuscle.core.morphing.sections import Branch, ClosedSurface
from vtkmuscle.core.types import GRAIN, ROUNDING, TINY, FloatMap, Floats, Ints

#: Classes of function values for the mean gradient. With 1024 mean lengths of fibres differ by at most 1 mm
#: in eight of ten muscles of a hip and a knee, by 19 and 23 mm in two with estimated areas.
N_CLASSES = 256
#: Isolines that measure the muscle's course, with 33 and 129 the same for eight of ten muscles.
N_ISOLINES = 65
#: Distance of the first and last isoline from the attachment areas, as a part of the muscle's length:
#: isolines at an area's rim have many coincident points. A hundredth moves points by 2 to 20 mm.
ISOLINE_MARGIN = 1e-3


def attachment_field(points: Floats, triangles: Ints, origin: Ints, insertion: Ints) -> Floats:
    """Return the harmonic function from origin (0) to insertion (1).

    Points (n, 3), triangles (m, 3), areas as point ids (k,); values (n,) in [0, 1]. Raises a ValueError if a
    role has no points, the areas overlap, or no connected part of the muscle has both areas.
    """
    for role, area in (("origin", origin), ("insertion", insertion)):
        if not len(area):
            problem = f"no point of the muscle is in the {role} area, and the function needs both areas"
            raise InputError("", problem)
    both = np.intersect1d(origin, insertion)
    if len(both):
        problem = f"the origin and the insertion area overlap: {len(both)} point(s) of the muscle are in both"
        raise InputError("", f"{problem}, the first is point {both[0]}", "make an area smaller")
    fixed = np.concatenate([origin, insertion])
    values = np.repeat([0.0, 1.0], [len(origin), len(insertion)])
    extension = harmonic_extension(points, triangles, fixed, values[:, None])
    # Along a chain of edges from 0 to 1 a step is at least 1 / number of points; a smaller step is rounding.
    if np.ptp(extension[triangles, 0], axis=1).max() < 1.0 / len(points):
        raise InputError("", "no connected part of the muscle has both an origin and an insertion area")
    return extension[:, 0]


class IsolineCourse:
    """Isolines of a function on a muscle, from its origin to its insertion.

    The isolines at `values` of the function (n,), of :func:`attachment_field`, are at `distances` along the
    muscle, see :func:`isoline_distances`. The main branch, with the part `share` of the muscle, is single
    from `begin` on, over `span` [mm]. `areas` are at the values 0 and 1. Raises a ValueError if no isoline
    has an inside.
    """

    def __init__(self, muscle: ClosedSurface, field: Floats) -> None:
        self.muscle, self.field = muscle.outward(), field
        self.values, self.distances = isoline_distances(muscle.points, muscle.triangles, field)
        self.length = float(self.distances[-1])
        regular = self.length * np.linspace(ISOLINE_MARGIN, 1.0 - ISOLINE_MARGIN, N_ISOLINES)
        branch = self.branch(self.muscle, regular)
        first, last = _single_branch(branch)
        self.begin, self.span = regular[first], regular[last] - regular[first]
        self.share = branch.share
        surface = self.muscle.points, self.muscle.triangles
        self.areas = [PatchSamples(*surface, np.flatnonzero(field == value)) for value in (0.0, 1.0)]

    def branch(self, surface: ClosedSurface, at: Floats) -> Branch:
        """Return the main branch at some distances, of the muscle in any coordinates."""
        levels = np.interp(at, self.distances, self.values)
        for i in range(1, len(levels)):  # strictly ascending, even after rounding
            levels[i] = max(levels[i], np.nextafter(levels[i - 1], 2.0))
        return Branch(surface, self.field, levels, at, lambda areas: np.linalg.norm(areas, axis=1))


def morph_by_isolines(
    points: Floats, transform: Floats, course: IsolineCourse, slicing: slices.Slicing
) -> slices.Morph:
    """Return template fibres moved into the muscle by isolines.

    A plane at a height of the template, as a part of its length, goes to the isoline at the same part of the
    distance from origin to insertion, measured on the surface and averaged around the isoline. Isolines and
    the planes' rectangles are matched with least twist between neighbours and least squared distances; the
    distances count less in parts of the muscle bent away from the box's axis. Fibre ends at the template's
    bottom and top go to the nearest points of the areas.

    points, transform, slicing : as for :func:`morph_by_planes`;
    course : IsolineCourse, isolines of the muscle in any pose.
    """
    box = slices.Box(transform)
    inside = box.coordinates(points)
    fractions = np.clip(inside[:, 2] / box.length, 0.0, 1.0)
    tolerance = max(slicing.slice_tolerance / box.length, ROUNDING)
    levels, slice_of = slices.shared_levels(fractions, tolerance, GRAIN)
    levels = course.begin + levels * course.span
    heights = course.begin + fractions * course.span
    guides = course.begin + slices.guide_levels(course.span)
    branch = course.branch(box.surface(course.muscle), np.union1d(levels, guides))

    def stack(at: Floats) -> tuple[LoopStack, Floats, Ints]:
        """Return loops, vector areas, and numbers of hit levels."""
        loops, hits = branch.stack(at, 3)
        areas = branch.areas[branch.at(at[hits])]
        return loops._replace(start_costs=_distances_from_rectangle(box.sides, areas)), areas, hits

    rings, areas, hits = stack(levels)
    axes = unit_vectors(areas)
    axes[~axes.any(axis=1), 2] = 1.0  # along z for a zero area
    views = np.array([[*perpendiculars(axis), axis] for axis in axes])
    maps = slices.slice_maps(rings, stack(guides)[0], box, slicing.continuity * course.length, views)
    mapped = box.positions(slices.mapped_points(inside, heights, levels, slice_of, maps, hits, views))
    ends = fractions <= ROUNDING, fractions >= 1.0 - ROUNDING
    for area, end in zip(course.areas, ends, strict=True):
        mapped[end] = area.tree.nearest(mapped[end])[1]
    return slices.Morph(mapped, course.share, 0.0)


def isoline_distances(points: Floats, triangles: Ints, field: Floats) -> tuple[Floats, Floats]:
    """Return mean distances of isolines along the surface. From the least value.

    ds/df is the length-weighted mean of 1 / |grad f| along an isoline: by the coarea formula, the ratio of
    the area to the integral of |grad f| between neighbouring isolines. The function (n,) in [0, 1] is linear
    on each triangle; values (k,) from 0 to 1 and distances (k,) from 0 on [mm] ascend strictly.
    """
    sizes = np.linalg.norm(triangle_normals(points, triangles), axis=1) / 2.0
    integrals = sizes * np.linalg.norm(triangle_gradients(points, triangles, field), axis=1)
    low, high = field[triangles].min(axis=1), field[triangles].max(axis=1)
    first = (low * N_CLASSES).astype(np.int64)
    last = np.minimum((high * N_CLASSES).astype(np.int64), N_CLASSES - 1)
    counts = np.where(high - low > ROUNDING, last - first + 1, 0)  # behind an area the function is constant
    t = np.repeat(np.arange(len(triangles)), counts)
    k = first[t] + np.arange(len(t)) - np.repeat(np.cumsum(counts) - counts, counts)
    shares = (np.minimum(high[t], (k + 1) / N_CLASSES) - np.maximum(low[t], k / N_CLASSES)) / (high - low)[t]
    areas, slopes = (np.bincount(k, shares * part[t], N_CLASSES) for part in (sizes, integrals))
    # A class without triangles is as steep as the mean.
    steps = np.full(N_CLASSES, areas.sum() / slopes.sum())
    np.divide(areas, slopes, out=steps, where=slopes > 0.0)
    return np.linspace(0.0, 1.0, N_CLASSES + 1), np.append(0.0, np.cumsum(steps)) / N_CLASSES


def _single_branch(branch: Branch) -> tuple[int, int]:
    """Return the first and last level of the single branch.

    An origin of several areas has an isoline around each; the isolines join towards the insertion.
    """
    sizes, numbers = branch.sizes, branch.numbers
    single = numbers >= 0
    for level in np.flatnonzero(single):
        rivals = [n for n in branch.sections.loops_of(int(level)) if n != numbers[level]]
        single[level] = not rivals or sizes[rivals].max() <= NOISE * sizes[numbers[level]]
    if not single.any():
        single = numbers >= 0
    # The longest run of levels with one branch.
    runs = np.flatnonzero(np.diff(single.astype(np.int64), prepend=0, append=0)).reshape(-1, 2)
    first, end = runs[np.diff(runs, axis=1)[:, 0].argmax()]
    return int(first), int(end) - 1


def _distances_from_rectangle(sides: Floats, areas: Floats) -> FloatMap:
    """Return the cost function of isoline starts.

    From positions (l, n, 3) on isolines to costs (l, n) [mm^2]: mean squared distances of an isoline, started
    at the position, from the rectangle, both about their centres. They count less for isolines with a vector
    area (3,) inclined to z.
    """
    width, depth = sides[:2]
    corners = np.array([(0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth)])
    rectangle = np.zeros((N_STARTS, 3))
    rectangle[:, :2] = sampled_loop(corners, np.zeros(2)) - [width / 2.0, depth / 2.0]
    along = areas[:, 2] / np.maximum(np.linalg.norm(areas, axis=1), TINY)

    def costs(positions: Floats) -> Floats:
        centred = positions - positions.mean(axis=1, keepdims=True)
        squares = (centred**2).sum(axis=2).mean(axis=1) + (rectangle**2).sum(axis=1).mean()
        products = cyclic_products(np.broadcast_to(rectangle, centred.shape), centred)
        return np.asarray((np.maximum(along, 0.0) ** 2)[:, None] * (squares[:, None] - 2.0 * products))

    return costs
