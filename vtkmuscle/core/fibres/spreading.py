"""Fibres spread evenly through a muscle, each in the middle of the part nearest to it, and smoothed.

Lloyd's relaxation, 1982, doi:10.1109/TIT.1982.1056489, of curves instead of points: the cell of a fibre is
the part of the muscle that is nearer to it than to the others, and each place along it goes to the centre of
the cell's part there. Cells overlap a little, so that the room between two fibres passes gradually from one
to the other and rounding decides nothing, not even where fibres meet. The papers leave fibres where the map
from the template puts them; that map crowds them in the middle of the muscle's sections.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.polylines import evenly_spaced, segment_lengths, smooth_polylines
from vtkmuscle.core.mesh.sampling import space_order
from vtkmuscle.core.mesh.surface import sorted_into_bins
from vtkmuscle.core.types import Floats, Ints


def smooth_about_course(points: Floats, offsets: Ints, k: float, passes: int) -> Floats:
    """Return fibres (n, 3) whose deviations from their common course are smoothed; end points are kept.

    A three-point mean moves the points of a bend of radius R, h apart, inwards by h^2 / (R (k + 2)): each
    pass over fibres of 15 segments round a roller costs up to 2 mm. But the mean of all fibres is the
    muscle's own course and no noise. So the change that the passes make to it is taken back. (Kohout et al.
    2012, section 3.4, has the passes, but no course.) Where there is one line, or lines differ in their
    numbers of points, there is no common course, and lines are smoothed as they are.

    Parameters
    ----------
    points, offsets : (n, 3) array, (m + 1,) int array
        Positions [mm]; first point of each line, and n.
    k : float
        Weight of the middle point, >= 0.
    passes : int
        Number of passes, >= 0.
    """
    smoothed: Floats = smooth_polylines(points, offsets, k, passes)
    counts = np.diff(offsets)
    if len(counts) < 2 or (counts != counts[0]).any():
        return smoothed
    course = points.reshape(len(counts), -1, 3).mean(axis=0)
    drawn_in = course - smooth_polylines(course, offsets[:2], k, passes)
    kept: Floats = smoothed + np.tile(drawn_in, (len(counts), 1))
    return kept


#: Places along a fibre that are moved; the points between them follow.
STATIONS = 16
#: Fewest passes of smoothing of the steps along a fibre. There are more where a cell is wider than stations
#: are apart, so that each station's part of the cell is as long as wide: else fibres meander.
LEAST_BLUR = 6
#: Pieces of the line between two stations, at most.
PIECES = 8
#: Overlap of cells: a place has a share in a sample if its squared distance exceeds that of the nearest place
#: by less than this part of the squared space between fibres (a twentieth of the space each way).
OVERLAP = 0.1
#: Part of a fibre along which points follow its end: less leaves hooks, more bare flanks.
REACH = 0.11
#: Most cells of the grid along a side.
FINEST = 256
#: Cells of the grid along its rows for each across them: rows take time, not the cells in them.
ALONG_ROWS = 2


@dataclass(frozen=True, eq=False)
class Cloud:
    """Samples (j, 3) of even density in a muscle, and the quantities that moving fibres leave unchanged.

    `low` and `high` are the corners of their box [mm]; `volume` is that of a box with the same spread, the
    muscle's to about a factor of two [mm^3]. `guesses` (j,) are the places that were nearest to each when
    fibres were moved last, -1 where they are not known: only the time taken depends on them.
    """

    samples: Floats
    low: Floats
    high: Floats
    volume: float
    guesses: Ints


def cloud(samples: Floats) -> Cloud:
    """Return sample points (j, 3), j >= 1, with their quantities."""
    # In an order in which neighbours follow each other, so that the places near them are in the cache.
    samples = samples[space_order(samples)]
    about = samples - samples.mean(axis=0)
    spread = about.T @ about / len(samples)
    volume = float(np.sqrt(12.0**3 * max(float(np.linalg.det(spread)), 0.0)))
    guesses = np.full(len(samples), -1)
    return Cloud(samples, samples.min(axis=0), samples.max(axis=0), volume, guesses)


def steps_to_centres(points: Floats, offsets: Ints, within: Cloud) -> Floats:
    """Return the displacements (n, 3) of points that bring fibres to the middles of their cells [mm].

    Fibres move across themselves, not along, and steps are smoothed along the fibre: so neighbours stay
    neighbours.
    """
    lines = evenly_spaced(points, offsets, STATIONS)
    low = np.minimum(within.low, lines.min(axis=(0, 1)))
    high = np.maximum(within.high, lines.max(axis=(0, 1)))
    length = float(np.linalg.norm(np.diff(lines, axis=1), axis=2).sum())
    extent, step = high - low, length / (len(lines) * (STATIONS - 1))
    # The space between fibres in the muscle.
    spacing = max(float(np.sqrt(within.volume / max(length, 1e-300))), 1e-300)
    pieces = int(np.clip(np.ceil(2.0 * step / spacing), 1, PIECES))
    scales = np.array([1.0, 1.0, ALONG_ROWS]) / max(spacing, float(extent.max()) / FINEST)
    shape = (extent * scales).astype(np.int64) + 1
    band = max(OVERLAP * spacing**2, 1e-300)
    pulls, weights = _pulls(lines, pieces, within, (low, scales, shape), band)
    wide = spacing / max(step, 1e-300)
    passes = int(np.clip(2.0 * wide**2, LEAST_BLUR, 2 * STATIONS**2))
    across = _across(lines, pulls, weights, _blur(passes))
    return _between(points, offsets, across)


def move_ends(points: Floats, ends: Ints, others: Ints, places: Floats) -> None:
    """Move one end of each fibre to a given place (k, 3), in place, and the points near it along.

    A fibre that moves while its end is held at the rim of its area hooks there. So the points beside it
    follow, the less the farther they are, up to :data:`REACH` of the fibre's points. `ends` and `others` (k,)
    are the ids of this end of each fibre and of its other one.
    """
    counts, ways = np.abs(others - ends), places - points[ends]
    fibre, j = np.nonzero(np.arange(counts.max(initial=0)) < REACH * counts[:, None])
    parts = 1.0 - j / (REACH * counts[fibre])
    points[ends[fibre] + np.sign(others - ends)[fibre] * j] += parts[:, None] * ways[fibre]
    points[ends] = places


def _between(points: Floats, offsets: Ints, shifts: Floats) -> Floats:
    """Interpolate values at stations (k, STATIONS, 3), evenly spaced along fibres, to their points."""
    along, counts = segment_lengths(points, offsets)[1], np.diff(offsets)
    begins, line = along[offsets[:-1]], np.repeat(np.arange(len(counts)), counts)
    lengths = (along[offsets[1:] - 1] - begins)[line]
    at = np.divide(along - begins[line], lengths, out=np.zeros(len(points)), where=lengths > 0.0)
    at *= STATIONS - 1
    station = np.minimum(at.astype(np.int64), STATIONS - 2)
    share = np.minimum(at - station, 1.0)[:, None]
    between: Floats = (1.0 - share) * shifts[line, station] + share * shifts[line, station + 1]
    return between


def _across(lines: Floats, pulls: Floats, weights: Floats, blur: Floats) -> Floats:
    """Return mean pulls (k, STATIONS, 3) of each station and its neighbours, across the line only."""
    pulls, weights = blur @ pulls, (weights @ blur.T)[..., None]
    mean = np.divide(pulls, weights, out=np.zeros(lines.shape), where=weights > 0.0)
    ends = np.pad(lines, ((0, 0), (1, 1), (0, 0)), mode="edge")
    ahead = ends[:, 2:] - ends[:, :-2]
    squares = np.maximum((ahead * ahead).sum(axis=2, keepdims=True), 1e-300)
    across: Floats = mean - (mean * ahead).sum(axis=2, keepdims=True) / squares * ahead
    return across


@lru_cache
def _blur(passes: int) -> Floats:
    """Return the matrix (STATIONS, STATIONS) that gives means of neighbours and keeps the sum."""
    once = 0.5 * np.eye(STATIONS) + 0.25 * (np.eye(STATIONS, k=1) + np.eye(STATIONS, k=-1))
    once[0, 0] = once[-1, -1] = 0.75
    return np.linalg.matrix_power(once, passes)


@kernel
def _square_to(places: Floats, i: int, x: float, y: float, z: float) -> float:
    """Return the squared distance of one of some places (q, 3) from a position."""
    dx, dy, dz = places[i, 0] - x, places[i, 1] - y, places[i, 2] - z
    square: float = dx * dx + dy * dy + dz * dz
    return square


def _divide(lines: Floats, pieces: int) -> tuple[Floats, Ints]:
    """Return places (q, 3) along lines, `pieces` from each station to the next, and their stations (q,)."""
    share = (np.arange(pieces) / pieces)[:, None]
    between = (1.0 - share) * lines[:, :-1, None] + share * lines[:, 1:, None]
    places = np.concatenate([between.reshape(len(lines), -1, 3), lines[:, -1:]], axis=1)
    stations = np.append(np.repeat(np.arange(STATIONS - 1), pieces), STATIONS - 2)
    return places.reshape(-1, 3), (np.arange(len(lines))[:, None] * STATIONS + stations).reshape(-1)


def _pulls(
    lines: Floats, pieces: int, within: Cloud, grid: tuple[Floats, Floats, Ints], band: float
) -> tuple[Floats, Floats]:
    """Return the summed offsets (k, STATIONS, 3) of the samples nearest to each place, and their number.

    Places whose squared distances are within a band [mm^2] of the least share a sample; the share is 0 at the
    end of the band. The grid is its corner (3,), its scales (3,), cells per mm, and its shape.
    """
    low, scales, shape = grid
    places, nodes = _divide(lines, pieces)
    cells = np.minimum(((places - low) * scales).astype(np.int64), shape - 1)
    order, offsets = sorted_into_bins(np.ravel_multi_index(tuple(cells.T), tuple(shape)), int(shape.prod()))
    pulls, weights = np.zeros((len(lines) * STATIONS, 3)), np.zeros(len(lines) * STATIONS)
    near, squares = np.empty(len(places) + 1, dtype=np.int64), np.empty(len(places) + 1)
    bins = places[order], order, offsets, low, scales, shape
    _pull(
        lines.reshape(-1, 3), nodes, within.samples, within.guesses, places, bins, band, near, squares, pulls,
        weights,
    )  # fmt: skip
    return pulls.reshape(lines.shape), weights.reshape(lines.shape[:2])


@kernel
def _pull(
    stations: Floats,
    nodes: Ints,
    samples: Floats,
    guesses: Ints,
    places: Floats,
    grid: tuple[Floats, Ints, Ints, Floats, Floats, Ints],
    band: float,
    near: Ints,
    squares: Floats,
    pulls: Floats,
    weights: Floats,
) -> None:
    """Add to the results of :func:`_pulls`, by the number of the station before each place."""
    in_cells, order, offsets, low, scales, shape = grid
    lx, ly, lz = low[0], low[1], low[2]
    nx, ny, nz = shape[0], shape[1], shape[2]
    across, along_rows = scales[0], scales[2]
    beside = 0  # the place nearest to the sample before is near
    for number in range(len(samples)):
        x, y, z = samples[number, 0], samples[number, 1], samples[number, 2]
        least, guess = _square_to(places, beside, x, y, z), guesses[number]
        if 0 <= guess < len(places):
            least = min(least, _square_to(places, guess, x, y, z))
        farthest = least * (1.0 + 1e-9) + band  # farther than the nearest in any case
        reach = np.sqrt(farthest)
        first = max(int((z - reach - lz) * along_rows), 0)
        last = min(int((z + reach - lz) * along_rows), nz - 1)
        bottom, top = max(int((y - reach - ly) * across), 0), min(int((y + reach - ly) * across), ny - 1)
        left, right = max(int((x - reach - lx) * across), 0), min(int((x + reach - lx) * across), nx - 1)
        found = 0
        for i in range(left, right + 1):
            for j in range(bottom, top + 1):
                row = (i * ny + j) * nz
                # Cells of a row are one after the other.
                for at in range(offsets[row + first], offsets[row + last + 1]):
                    square = _square_to(in_cells, at, x, y, z)
                    near[found], squares[found] = at, square
                    found += 1 if square < farthest else 0
        least, nearest = squares[0], near[0]
        for k in range(1, found):
            if squares[k] < least:
                least, nearest = squares[k], near[k]
        guesses[number] = beside = order[nearest]
        farthest = least * (1.0 + 1e-9) + band
        total = 0.0
        for k in range(found):
            total += max(farthest - squares[k], 0.0)
        for k in range(found):
            share = (farthest - squares[k]) / total
            if share <= 0.0:
                continue
            node = nodes[order[near[k]]]
            ax, ay, az = stations[node, 0], stations[node, 1], stations[node, 2]
            bx, by, bz = stations[node + 1, 0] - ax, stations[node + 1, 1] - ay, stations[node + 1, 2] - az
            squared = bx * bx + by * by + bz * bz
            along = (x - ax) * bx + (y - ay) * by + (z - az) * bz
            along = min(max(along / squared if squared > 0.0 else 0.0, 0.0), 1.0)
            after = along * share
            before = share - after
            weights[node] += before
            weights[node + 1] += after
            sx, sy, sz = x - (ax + along * bx), y - (ay + along * by), z - (az + along * bz)
            pulls[node, 0] += before * sx
            pulls[node, 1] += before * sy
            pulls[node, 2] += before * sz
            pulls[node + 1, 0] += after * sx
            pulls[node + 1, 1] += after * sy
            pulls[node + 1, 2] += after * sz
