"""Fibres spread evenly through a muscle by relaxation, and smoothed.

Lloyd's relaxation, 1982, doi:10.1109/TIT.1982.1056489, of curves instead of points: the cell of a fibre is
the part of the muscle nearest to the fibre, and each station along the fibre moves to the centre of its part
of the cell. Cells overlap a little, so the space between two fibres passes gradually from one cell to the
next, and rounding decides nothing. The papers keep fibres as mapped from the template, crowded in the middle
of the muscle's sections.
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.polylines import evenly_spread, smooth_polylines, stations_of
from vtkmuscle.core.mesh.sampling import space_order
from vtkmuscle.core.mesh.surface import box_of, signed_volume, sorted_into_bins
from vtkmuscle.core.types import ROUNDING, Floats, Ints

#: Segments of the published fibres (Kohout, Cervenka 2021, section 4); weights of smoothing are for so many.
SEGMENTS = 15


def smoothing_of(segments: float, k: float = 4.0) -> tuple[float, int]:
    """Return the weight and the passes that smooth as far as a pass over fibres of :data:`SEGMENTS` segments.

    That pass has the weight k >= 0. A pass blurs by 2 / (k + 2) squared segments: blurred by as many
    segments, whatever their length, fibres get rougher and longer with each halving of the segments.
    """
    share = (segments / SEGMENTS) ** 2
    passes = math.ceil(share - ROUNDING)
    return (k + 2.0) * passes / share - 2.0, passes


def smooth_about_course(points: Floats, offsets: Ints, k: float, passes: int) -> Floats:
    """Return fibres (n, 3) smoothed about their common course.

    A three-point mean moves the points of a bend of radius R, h apart, inwards by h^2 / (R (k + 2)): each
    pass over fibres of 15 segments round a roller costs up to 2 mm. The mean of all fibres is the muscle's
    course, free of noise, so the change of the mean is taken back. (Kohout et al. 2012, section 3.4, has the
    passes without a course.) A single line, and lines with different numbers of points, have no common
    course.

    points, offsets : (n, 3), (m + 1,), positions [mm]; first point of each line, and n;
    k : weight of the middle point, >= 0;
    passes : number of passes, >= 0.
    """
    smoothed: Floats = smooth_polylines(points, offsets, k, passes)
    counts = np.diff(offsets)
    if len(counts) < 2 or (counts != counts[0]).any():
        return smoothed
    course = points.reshape(len(counts), -1, 3).mean(axis=0)
    drawn_in = course - smooth_polylines(course, offsets[:2], k, passes)
    return np.asarray(smoothed + np.tile(drawn_in, (len(counts), 1)))


#: Stations along a fibre that are moved; points between stations follow. For ten muscles of a hip and a knee
#: 8 and 32 move the points of fibres by 0.4 to 2 mm (root mean square).
STATIONS = 16
#: Fewest smoothing passes of the steps along a fibre. Cells wider than the distance of stations need more, or
#: fibres meander: without passes turns in the ten muscles are larger by up to 46 degrees, with 12 they change
#: by at most 3.
LEAST_BLUR = 6
#: Most pieces of the line between two stations: 4 move the points of fibres by up to 1.5 mm, 16 by up to 0.8.
PIECES = 8
#: Overlap of cells: a node shares a sample if its squared distance exceeds the least by less than this part
#: of the squared fibre spacing (a twentieth of the spacing each way). 0 and 0.2 move points by 0.2 to 0.6 mm.
OVERLAP = 0.1
#: Part of a fibre along which points follow its end: less leaves hooks, more leaves bare flanks. With 0 turns
#: are larger by up to 9 degrees, with 0.22 by up to 8.
REACH = 0.11
#: Most cells of the grid along a side: 270 MB of numbers. The ten muscles need fewer.
FINEST = 256


class Cloud(NamedTuple):
    """Samples (j, 3) of even density in a muscle, and the muscle's volume [mm^3]."""

    samples: Floats
    volume: float


def cloud(samples: Floats, points: Floats, triangles: Ints) -> Cloud:
    """Return samples (j, 3), j >= 1, of a muscle with a surface."""
    samples = samples[space_order(samples)]  # neighbours in sequence find the same nodes in the cache
    return Cloud(samples, abs(signed_volume(points, triangles)))


def steps_to_centres(points: Floats, offsets: Ints, within: Cloud) -> Floats:
    """Return displacements (n, 3) to the middles of cells [mm].

    Fibres move across themselves, and steps are smoothed along the fibre, which preserves neighbours.
    """
    lines = evenly_spread(points, offsets, STATIONS)
    low, high = box_of(np.vstack([within.samples, lines.reshape(-1, 3)]))
    length = float(np.linalg.norm(np.diff(lines, axis=1), axis=2).sum())
    extent, step = high - low, length / (len(lines) * (STATIONS - 1))
    spacing = max(float(np.sqrt(within.volume / max(length, 1e-300))), 1e-300)  # between fibres
    pieces = int(np.clip(np.ceil(2.0 * step / spacing), 1, PIECES))
    scale = 1.0 / max(spacing, float(extent.max()) / FINEST)
    shape = (extent * scale).astype(np.int64) + 1
    pulls, weights = _pulls(lines, pieces, within, (low, scale, shape), max(OVERLAP * spacing**2, 1e-300))
    wide = spacing / max(step, 1e-300)
    blur = _blur(int(np.clip(2.0 * wide**2, LEAST_BLUR, 2 * STATIONS**2)))
    return _between(points, offsets, _across(lines, pulls, weights, blur))


def move_ends(points: Floats, ends: Ints, opposite: Ints, targets: Floats) -> None:
    """Move fibre ends to targets (k, 3), in place. Points next to the ends follow.

    A fibre with an end held at the rim of its area would hook there. So points up to :data:`REACH` of the
    fibre follow the end, in proportion. `ends` and `opposite` (k,) are the ids of both ends.
    """
    counts, shifts = np.abs(opposite - ends), targets - points[ends]
    fibre, j = np.nonzero(np.arange(counts.max(initial=0)) < REACH * counts[:, None])
    parts = 1.0 - j / (REACH * counts[fibre])
    points[ends[fibre] + np.sign(opposite - ends)[fibre] * j] += parts[:, None] * shifts[fibre]
    points[ends] = targets


def _between(points: Floats, offsets: Ints, shifts: Floats) -> Floats:
    """Interpolate shifts (k, STATIONS, 3) to the points of fibres."""
    line, station, share = stations_of(points, offsets, STATIONS)
    low, high = shifts[line, station], shifts[line, station + 1]
    return np.asarray((1.0 - share)[:, None] * low + share[:, None] * high)


def _across(lines: Floats, pulls: Floats, weights: Floats, blur: Floats) -> Floats:
    """Return blurred mean pulls across the line. Pulls (k, STATIONS, 3)."""
    ends = np.pad(lines, ((0, 0), (1, 1), (0, 0)), mode="edge")
    ahead = unit_vectors(ends[:, 2:] - ends[:, :-2])

    def across(steps: Floats) -> Floats:
        return np.asarray(steps - (steps * ahead).sum(axis=2, keepdims=True) * ahead)

    pulls, weights = blur @ across(pulls), (weights @ blur.T)[..., None]
    return across(np.divide(pulls, weights, out=np.zeros(lines.shape), where=weights > 0.0))


@lru_cache
def _blur(passes: int) -> Floats:
    """Return the matrix (STATIONS, STATIONS) of repeated means. Three-point means keep the sum."""
    once = 0.5 * np.eye(STATIONS) + 0.25 * (np.eye(STATIONS, k=1) + np.eye(STATIONS, k=-1))
    once[0, 0] = once[-1, -1] = 0.75
    return np.linalg.matrix_power(once, passes)


@kernel
def _square_to(nodes: Floats, i: int, x: float, y: float, z: float) -> float:
    """Return the squared distance of a node from a position."""
    dx, dy, dz = nodes[i, 0] - x, nodes[i, 1] - y, nodes[i, 2] - z
    return float(dx * dx + dy * dy + dz * dz)


def _pulls(
    lines: Floats, pieces: int, within: Cloud, grid: tuple[Floats, float, Ints], band: float
) -> tuple[Floats, Floats]:
    """Return summed offsets and numbers of samples in cells. Offsets (k, STATIONS, 3).

    Between stations a fibre is a parabola: a chord of 11 mm is up to 0.5 mm off a bend of 30 mm. Nodes within
    a band of the least squared distance [mm^2] share a sample; the share falls to 0 at the end of the band.
    The grid is its corner (3,), its scale [1/mm], and its shape.
    """
    low, scale, shape = grid
    share = (np.arange(pieces) / pieces)[:, None]
    bends = np.pad(np.diff(lines, 2, axis=1), ((0, 0), (1, 1), (0, 0)), mode="edge")
    bends = 0.25 * (bends + np.roll(bends, -1, axis=1))
    between = (1.0 - share) * (lines[:, :-1, None] - share * bends[:, :-1, None]) + share * lines[:, 1:, None]
    nodes = np.concatenate([between.reshape(len(lines), -1, 3), lines[:, -1:]], axis=1).reshape(-1, 3)
    stations = np.append(np.repeat(np.arange(STATIONS - 1), pieces), STATIONS - 2)
    station_of = (np.arange(len(lines))[:, None] * STATIONS + stations).reshape(-1)
    cells = np.minimum(((nodes - low) * scale).astype(np.int64), shape - 1)
    order, offsets = sorted_into_bins(np.ravel_multi_index(tuple(cells.T), tuple(shape)), int(shape.prod()))
    pulls, weights = np.zeros((len(lines) * STATIONS, 3)), np.zeros(len(lines) * STATIONS)
    memory = np.empty(len(nodes) + 1, dtype=np.int64), np.empty(len(nodes) + 1)
    bins = nodes[order], station_of[order], offsets, low, scale, shape
    _pull(lines.reshape(-1, 3), bends.reshape(-1, 3), within.samples, bins, band, *memory, pulls, weights)
    return pulls.reshape(lines.shape), weights.reshape(lines.shape[:2])


@kernel
def _pull(
    stations: Floats, bends: Floats, samples: Floats, grid: tuple[Floats, Ints, Ints, Floats, float, Ints],
    band: float, candidates: Ints, squares: Floats, pulls: Floats, weights: Floats,
) -> None:  # fmt: skip
    """Add to the results of :func:`_pulls`; candidates, squares : memory."""
    nodes, station_of, offsets, low, scale, shape = grid
    lx, ly, lz = low[0], low[1], low[2]
    nx, ny, nz = shape[0], shape[1], shape[2]
    nearest = 0  # the node nearest to the sample before bounds the search
    for number in range(len(samples)):
        x, y, z = samples[number, 0], samples[number, 1], samples[number, 2]
        farthest = _square_to(nodes, nearest, x, y, z) * (1.0 + ROUNDING) + band
        reach = np.sqrt(farthest)
        first, last = max(int((z - reach - lz) * scale), 0), min(int((z + reach - lz) * scale), nz - 1)
        bottom, top = max(int((y - reach - ly) * scale), 0), min(int((y + reach - ly) * scale), ny - 1)
        left, right = max(int((x - reach - lx) * scale), 0), min(int((x + reach - lx) * scale), nx - 1)
        count = 0
        for i in range(left, right + 1):
            for j in range(bottom, top + 1):
                row = (i * ny + j) * nz  # cells of a row are consecutive
                for node in range(offsets[row + first], offsets[row + last + 1]):
                    square = _square_to(nodes, node, x, y, z)
                    if square < farthest:
                        candidates[count], squares[count] = node, square
                        count, farthest = count + 1, min(farthest, square * (1.0 + 1e-9) + band)
        least, nearest = squares[0], candidates[0]
        for k in range(1, count):
            if squares[k] < least:
                least, nearest = squares[k], candidates[k]
        farthest = least * (1.0 + ROUNDING) + band
        total = 0.0
        for k in range(count):
            total += max(farthest - squares[k], 0.0)
        for k in range(count):
            share = (farthest - squares[k]) / total
            if share <= 0.0:
                continue
            node = station_of[candidates[k]]
            ax, ay, az = stations[node, 0], stations[node, 1], stations[node, 2]
            bx, by, bz = stations[node + 1, 0] - ax, stations[node + 1, 1] - ay, stations[node + 1, 2] - az
            squared = bx * bx + by * by + bz * bz
            along = (x - ax) * bx + (y - ay) * by + (z - az) * bz
            along = min(max(along / squared if squared > 0.0 else 0.0, 0.0), 1.0)
            after, bow = along * share, along * (1.0 - along)
            ax, ay, az = ax - bow * bends[node, 0], ay - bow * bends[node, 1], az - bow * bends[node, 2]
            offset = x - (ax + along * bx), y - (ay + along * by), z - (az + along * bz)
            for end, part in ((node, share - after), (node + 1, after)):
                weights[end] += part
                for axis in range(3):
                    pulls[end, axis] += part * offset[axis]
