"""Published measures of fibres: curvature, lines of action, cross-sections, groups."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial
from scipy.spatial import cKDTree

from vtkmuscle.core.mesh.normals import angles_between, unit_vectors
from vtkmuscle.core.mesh.polylines import curve_segments, evenly_spaced, hooks, nearest_arcs, polyline_lengths
from vtkmuscle.core.types import ROUNDING, Bools, Floats, Ints


def centroid_path(points: Floats, offsets: Ints, count: int) -> Floats:
    """Return the mean polyline (count, 3) [mm]. Means are at equal parts of the lines' lengths."""
    return np.asarray(evenly_spaced(points, offsets, count).mean(axis=0))


def line_of_action(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return the unit mean chord (3,), 0 for coincident ends, and angles (k,) of chords to it [degrees]."""
    chords = points[offsets[1:] - 1] - points[offsets[:-1]]
    direction = unit_vectors(chords.mean(axis=0))
    return direction, angles_between(chords, direction)


def physiological_cross_section(volume: float, lengths: Floats, angles: Floats) -> tuple[float, float]:
    """Return the physiological cross-sectional area [mm^2]. Also its part along the line of action.

    The area is volume / mean fibre length; the part is the area times the mean cosine of the fibres' angles
    to the line of action (Lieber, Friden 2000, doi:10.1002/1097-4598(200011)23:11<1647::AID-MUS1>3.0.CO;2-M).
    Volume [mm^3] of the muscle; lengths [mm] and angles [degrees] of the fibres, (k,).
    """
    area = abs(volume) / float(lengths.mean())
    return area, area * float(np.cos(np.radians(angles)).mean())


def section_areas(points: Floats, triangles: Ints, centres: Floats, normals: Floats) -> Floats:
    """Return areas (s,) of plane sections [mm^2]. The surface is closed and oriented.

    Planes have points (s, 3) and unit normals (s, 3).
    """
    areas = []
    for centre, normal in zip(centres, normals, strict=True):
        heights = (points - centre) @ normal
        a, b, c = (heights < 0.0)[triangles.T]
        met = triangles[(a != b) | (b != c)]
        corners, low = points[met] - centre, heights[met]
        after, high = np.roll(corners, -1, axis=1), np.roll(low, -1, axis=1)
        # Each triangle met has an edge that rises through the plane, and an edge that falls.
        rising, falling = (low < 0.0) & (high >= 0.0), (low >= 0.0) & (high < 0.0)
        share = np.divide(low, low - high, out=np.zeros_like(low), where=rising | falling)[..., None]
        across = corners + share * (after - corners)
        areas.append(0.5 * abs(float(np.cross(across[rising], across[falling]).sum(axis=0) @ normal)))
    return np.array(areas)


def group_fibres(lengths: Floats, count: int) -> Ints:
    """Return the group of each fibre (n,). From fibre lengths in each pose (f, n).

    K-means of the changes of length about their means: fibres of a group have equal moment arms, whatever
    their lengths. Few or similar fibres give fewer groups.
    """
    from scipy.cluster.vq import kmeans2  # noqa: PLC0415 -- few need it, and it takes a while to load

    changes = (lengths - lengths.mean(axis=0)).T
    count = max(1, min(count, len(np.unique(changes.round(12), axis=0))))
    if count == 1:
        return np.zeros(len(changes), dtype=np.int64)
    _, labels = kmeans2(changes, count, minit="++", rng=np.random.default_rng(0), missing="warn")
    # Groups are numbered by their first fibre, without empty groups.
    _, first, plain = np.unique(labels, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(first))[plain].astype(np.int64)


#: Stations along each fibre, with half and twice of which up to 6 % more or fewer neighbours in ten muscles
#: cross; number of stations from an end to the station compared with the end, an eighth by definition.
STATIONS, INWARD = 33, 4
#: Nearest neighbours of a fibre: the sides of a square.
SIDES = 4
#: Neighbours meet, without a side, below this part of the median distance at a station. With 0 up to 8 % more
#: of the neighbours in ten muscles of a hip and a knee seem to cross, with 0.5 up to 6 % fewer.
MEET = 0.25


def angles_to_inner_sheet(ends: Floats, directions: Floats, within: Bools) -> tuple[Bools, Floats]:
    """Return which fibre ends (k, 3) span a sheet within a muscle, and their angles to it [degrees].

    Of an end and its neighbours most are ``within`` (k,) the muscle, off its surface, which the sheet's rim
    may meet. The sheet is their plane of least squares: the ends are nearer to a plane than to a line.
    Directions (k, 3) are unit vectors.
    """
    near = cKDTree(ends).query(ends, np.arange(1, min(SIDES + 1, len(ends)) + 1))[1]
    arms = ends[near] - ends[near].mean(axis=1, keepdims=True)
    sizes, axes = np.linalg.eigh(np.swapaxes(arms, 1, 2) @ arms)
    low, middle, high = sizes.T
    inner = (within[near].mean(axis=1) > 0.5) & (middle**2 > np.maximum(low, ROUNDING * high) * high)
    sines = np.abs((axes[inner, :, 0] * directions[inner]).sum(axis=1))
    return inner, np.degrees(np.arcsin(np.minimum(sines, 1.0)))


class Arrangement(NamedTuple):
    """Measures of fibres at rest.

    `crossing` is the part of neighbours that change sides in the last eighth of their length, at the worse
    end. `hooked` is the part of fibres that turn by 60 degrees more than the muscle's course, the mean of the
    fibres, between a tenth of their length and the next. `turning` is the 95th percentile of the summed turns
    along a fibre [degrees]. `bare` is the part of the muscle's volume farther from any fibre than the side of
    a square with a fibre's share of the largest section: 0 for parallel fibres in a square or hexagonal
    pattern, exp(-pi), 4 %, for a random pattern.
    """

    crossing: float
    hooked: float
    turning: float
    bare: float


def arrangement(points: Floats, offsets: Ints, samples: Floats, volume: float) -> Arrangement:
    """Return the arrangement of fibres in a muscle of a volume, with samples (m, 3) of even density."""
    fibres = [points[a:b] for a, b in pairwise(offsets)]
    lines = evenly_spaced(points, offsets, STATIONS)
    # Between the points of finer fibres the grain of the surface turns them, not their course.
    courses = [line if len(fibre) > STATIONS else fibre for line, fibre in zip(lines, fibres, strict=True)]
    proper = [each[each.any(axis=1)] for each in (np.diff(course, axis=0) for course in courses)]
    turns = [angles_between(each[1:], each[:-1]) for each in proper]
    neighbours, bare = _neighbours(lines[:, STATIONS // 2]), 0.0
    if len(samples):
        spacing = _spacing(lines, offsets, points, samples, abs(volume))
        # A point between two stations half a spacing apart seems farther by 3 %, at most.
        stations = math.ceil(2.0 * polyline_lengths(points, offsets).max() / spacing) + 1
        near = cKDTree(evenly_spaced(points, offsets, stations).reshape(-1, 3))
        bare = float((near.query(samples)[0] > spacing).mean())
    crossing = max(_crossing(lines, neighbours), _crossing(lines[:, ::-1], neighbours))
    turning = float(np.percentile([turn.sum() for turn in turns], 95.0))
    return Arrangement(crossing, hooks(points, offsets), turning, bare)


def _neighbours(middle: Floats) -> Ints:
    """Return the four (or fewer) nearest fibres, (n, 4). Distances are in the middle."""
    count = min(SIDES, len(middle) - 1)
    nearest = cKDTree(middle).query(middle, range(1, count + 2))[1]
    # The fibre itself is among the nearest, though not always first among coincident fibres.
    return np.array([row[row != number][:count] for number, row in enumerate(nearest)], dtype=np.int64)


def _spacing(lines: Floats, offsets: Ints, points: Floats, samples: Floats, volume: float) -> float:
    """Return the spacing of an even pattern in the largest section [mm].

    A fibre's share is the largest section that half of the fibres pass, by the number of fibres that pass
    it, or the volume by the length of all fibres, where no section is passed by half of them.
    """
    path = centroid_path(points, offsets, NODES)
    counts, edges = np.histogram(along(path, samples)[0], NODES - 1)
    stations = along(path, lines.reshape(-1, 3))[0].reshape(lines.shape[:2])
    middles = 0.5 * (edges[1:] + edges[:-1])
    passing = (stations.min(axis=1) <= middles[:, None]) & (stations.max(axis=1) >= middles[:, None])
    fibres = passing.sum(axis=1)
    sections = volume * counts / len(samples) / (edges[1] - edges[0])
    passed = 2 * fibres >= len(lines)
    share = volume / float(polyline_lengths(points, offsets).sum())
    if passed.any():
        largest = np.where(passed, sections, 0.0).argmax()
        share = max(share, float(sections[largest] / fibres[largest]))
    return float(np.sqrt(share))


def _crossing(lines: Floats, neighbours: Ints) -> float:
    """Return the part of neighbours that change sides. Between the first station and `INWARD`."""
    ahead = unit_vectors((lines[:, [1, INWARD + 1]] - lines[:, [0, INWARD]]).reshape(-1, 3)).reshape(-1, 2, 3)
    stations = lines[:, [0, INWARD]]
    sides = stations[neighbours] - stations[:, None]
    sides -= (sides * ahead[:, None]).sum(axis=-1, keepdims=True) * ahead[:, None]
    apart = np.linalg.norm(sides, axis=-1)
    if not apart.size:
        return 0.0
    clear = (apart > MEET * np.median(apart, axis=(0, 1))).all(axis=-1)
    return float(((sides[:, :, 0] * sides[:, :, 1]).sum(axis=-1) < 0.0)[clear].mean()) if clear.any() else 0.0


#: Area of a muscle over that of its tendon, at which both together are lightest (Ker, Alexander, Bennett
#: 1988, *Why are mammalian tendons so thick?*, Journal of Zoology 216, 309-324).
MUSCLE_FOR_TENDON = 34.0
#: A section with less than this part of the largest area counts as tendon: half way between the areas of
#: muscle and tendon on a logarithmic scale; then limits, a quarter of the scale to either side.
TENDON_AREAS = (MUSCLE_FOR_TENDON**-0.5, MUSCLE_FOR_TENDON**-0.75, MUSCLE_FOR_TENDON**-0.25)
#: Points of the medial curve, passes of the fit, number of cross-sections. With half and with twice of all
#: three the angles of fascicles in four muscles of a real hip change by 3 degrees, and lengths by 1 mm.
NODES, PASSES, SECTIONS = 17, 8, 40
#: Samples of a fibre along the curve, by half of which lengths in ten muscles change by up to 1 mm; part of
#: a fascicle that gives its end a direction, by half and twice of which angles change by 3 and 8 degrees.
POINTS, END = 121, 0.1


class AreaProfile(NamedTuple):
    """Areas of muscle cross-sections along a medial curve. Areas (s,) [mm^2], curve (c, 3) [mm].

    `arcs` (s,) are the middles of equal pieces of the curve, which passes both ends of the muscle.
    """

    curve: Floats
    arcs: Floats
    areas: Floats

    def muscle_between(self, share: float) -> tuple[float, float]:
        """Return the arcs [mm] between which sections exceed a share of the largest area."""
        least = share * float(self.areas.max())
        thick = np.flatnonzero(self.areas >= least)
        return self._crossing(int(thick[0]), -1, least), self._crossing(int(thick[-1]), 1, least)

    def volume_share(self, low: float, high: float) -> float:
        """Return the part of the volume between two arcs [mm]."""
        half = (self.arcs[1] - self.arcs[0]) / 2.0
        inside = np.minimum(self.arcs + half, high) - np.maximum(self.arcs - half, low)
        return float(np.clip(inside / (2.0 * half), 0.0, 1.0) @ self.areas / self.areas.sum())

    def _crossing(self, last: int, step: int, least: float) -> float:
        """Return the arc beyond section `last` with the least area."""
        share, after = 0.5, last + step
        if 0 <= after < len(self.arcs):
            share = (self.areas[last] - least) / (self.areas[last] - self.areas[after])
        return float(self.arcs[last] + step * share * (self.arcs[1] - self.arcs[0]))


class Fascicles(NamedTuple):
    """Fascicles: the parts of fibres within the muscle, without tendon.

    Lengths (k,) [mm] are 0 for a fibre without a part in the muscle. Angles (k,) are between the ends of
    fascicles and the medial curve [degrees]. `volume` is the muscle's [mm^3].
    """

    lengths: Floats
    origin_angles: Floats
    insertion_angles: Floats
    volume: float

    def cross_section(self, lengths: Floats | None = None) -> float:
        """Return the physiological cross-sectional area: volume cos(pennation) / length [mm^2].

        After Lieber and Friden 2000, with the mean angle of both ends and the mean fascicle length, or the
        mean of ``lengths`` (k,) [mm].
        """
        angles = np.concatenate([self.origin_angles, self.insertion_angles])
        mean = float((self.lengths if lengths is None else lengths).mean())
        return self.volume * float(np.cos(np.radians(angles)).mean()) / mean if mean > 0.0 else 0.0


def area_profile(surface: Floats, faces: Ints, samples: Floats, points: Floats, offsets: Ints) -> AreaProfile:
    """Return the cross-sections of a muscle along its course.

    The medial curve is a principal curve (Hastie, Stuetzle 1989, doi:10.1080/01621459.1989.10478797). The fit
    begins with the centroid path of the fibres, and each pass fits a parabola to samples (j, 3) of even
    density in the muscle. Curves of a higher degree curl in thick muscles. In a pennate muscle the curve runs
    along the muscle and across the fibres. The surface (p, 3), (m, 3) is closed and faces outward; fibres (n,
    3), (k + 1,) run from origin to insertion.
    """
    curve = centroid_path(points, offsets, NODES)
    for _ in range(PASSES):
        arcs, _ = along(curve, samples)
        nodes = np.linspace(arcs.min(), arcs.max(), NODES)
        curve = np.column_stack([Polynomial.fit(arcs, x, deg=2)(nodes) for x in samples.T])
    arcs, _ = along(curve, surface)
    bounds = np.linspace(arcs.min(), arcs.max(), SECTIONS + 1)
    middles = (bounds[1:] + bounds[:-1]) / 2.0
    begins, _, directions = curve_segments(curve)
    segment = np.clip(np.searchsorted(begins, middles, side="right") - 1, 0, len(begins) - 1)
    centres = curve[segment] + (middles - begins[segment])[:, None] * directions[segment]
    return AreaProfile(curve, middles, section_areas(surface, faces, centres, directions[segment]))


def along(curve: Floats, positions: Floats) -> tuple[Floats, Floats]:
    """Return arcs (n,) [mm] and directions (n, 3) of a curve (c, 3), by :func:`nearest_arcs`."""
    arcs, segments = nearest_arcs(curve, positions)
    return arcs, curve_segments(curve)[2][segments]


def fascicles(
    profile: AreaProfile, volume: float, points: Floats, offsets: Ints, *, shares: Sequence[float]
) -> list[Fascicles]:
    """Return the fascicles of fibres for each limit of tendon.

    Sections with less than a share of the largest area count as tendon. The volume is the muscle's [mm^3].
    """
    dense, whole = evenly_spaced(points, offsets, POINTS), polyline_lengths(points, offsets)
    arcs, directions = (x.reshape(len(dense), POINTS, -1) for x in along(profile.curve, dense.reshape(-1, 3)))
    parts, row = [], np.arange(len(dense))
    for low, high in map(profile.muscle_between, shares):
        within = (arcs[..., 0] >= low) & (arcs[..., 0] <= high)
        # A piece of a fibre counts by half if one of its ends is in the muscle.
        pieces = (within[:, 1:].astype(np.float64) + within[:, :-1]) / 2.0
        counts, first = within.sum(axis=1), within.argmax(axis=1)
        last = POINTS - 1 - within[:, ::-1].argmax(axis=1)
        reach = np.where(counts > 1, np.maximum(1, np.round(END * counts)), 0).astype(np.int64)
        a, b = np.array([first, last - reach]), np.array([first + reach, last])
        chords, axes = dense[row, b] - dense[row, a], directions[row, (a + b) // 2]
        across = np.linalg.norm(np.cross(chords, axes), axis=2)
        origin, insertion = np.degrees(np.arctan2(across, np.abs((chords * axes).sum(axis=2))))
        share = profile.volume_share(low, high)
        parts.append(Fascicles(whole * pieces.mean(axis=1), origin, insertion, volume * share))
    return parts


def segment_errors(lines: Floats) -> Floats:
    """Bound the shortening of polylines (k, n, 3) against curves, (k,) [mm].

    The bound is the length by all points, less the length by every second point and the last. Chords of
    smooth curves converge with the second order, so the difference is three times the error (Richardson).
    """
    halved = np.concatenate([lines[:, :-1:2], lines[:, -1:]], axis=1)
    whole, less = (np.linalg.norm(np.diff(each, axis=1), axis=2).sum(axis=1) for each in (lines, halved))
    return np.asarray(whole - less)


#: Error of the model in standard deviations of a muscle's paths, and its growth as the muscle shortens. Both
#: are of 15 phantoms without via rings: benchmarks/stated_errors.py, docs/validation/how_right.rst.
MODEL, SHORTENED = 0.81, 4.0
#: Half width of an interval that holds 95 % of a normal distribution, in standard deviations.
NORMAL = 1.96


def mean_errors(values: Floats, ratios: Floats, **further: Floats) -> dict[str, Floats]:
    """Return the errors of means over a muscle's paths.

    ``total`` (f,) is the half width of the interval about the mean with the known answer in 95 % of the poses
    of phantoms: the root of the sum of squares of the parts ``model``, ``sampling`` (the mean is of k paths),
    and those ``further``. NaN for a single path.

    values : (f, k), of the paths;
    ratios : (f,), mean lengths relative to rest;
    further : (f,) each, further parts, in the unit of the values: ``numerical`` and ``bow``.
    """
    count = values.shape[1]
    spread = values.std(axis=1, ddof=1) if count > 1 else np.full(len(values), np.nan)
    model = MODEL * (1.0 + SHORTENED * np.maximum(1.0 - ratios, 0.0)) * spread
    parts = {"model": model, "sampling": NORMAL / np.sqrt(count) * spread, **further}
    return {"total": np.linalg.norm(list(parts.values()), axis=0), **parts}


def root_mean_square(values: Floats) -> float | None:
    """Return the root mean square without NaN. None if all values are NaN."""
    numbers = values[~np.isnan(values)]
    return float(np.sqrt((numbers**2).mean())) if len(numbers) else None
