"""Fibres spread evenly through a muscle: each moves to the middle of what is nearest to it.

Lloyd's relaxation, 1982, doi:10.1109/TIT.1982.1056489, of curves instead of points: the cell of a fibre is
the part of the muscle that is nearer to it than to the others, and each place along it goes to the centre of
the cell's part there. Cells overlap a little: what is between two fibres goes over from one to the other
rather than jumping, so that rounding decides nothing, not even where fibres meet. The papers leave fibres
where the map from the template puts them; that map is even in the template, but crowds them in the middle of
the muscle's sections.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.bins import sorted_into_bins
from vtkmuscle.core.mesh.polylines import distance_between, even_arcs, resample_polyline
from vtkmuscle.core.types import Floats, Ints

#: Places along a fibre that are moved; what is between them follows.
STATIONS = 16
#: Fewest passes of smoothing, along the fibre, of what its cell says. More where a cell is wider than
#: stations are apart, for each station's part of the cell to be as long as wide: else fibres meander.
LEAST_BLUR = 6
#: Pieces of the line between two stations, at most.
PIECES = 8
#: How far cells overlap: places have a share in what is around them if they are no farther from it, squared,
#: than the nearest place is and this part of the squared space between fibres (a twentieth of it each way).
OVERLAP = 0.1
#: How far along a fibre, as a part of it, points follow its end: less leaves hooks, more bare flanks.
REACH = 0.11
#: Most cells of the grid along a side.
FINEST = 256
#: Cells along a side by which positions are sorted.
_CELLS = 64


@dataclass(frozen=True, eq=False)
class Cloud:
    """Positions in a muscle, of even density, and what does not change as fibres move among them.

    Attributes
    ----------
    samples : (j, 3) array
        The positions, j >= 1 [mm].
    low, high : (3,) arrays
        The corners of their box [mm].
    volume : float
        That of a box with the same spread, to about a factor of two [mm^3].
    guesses : (j,) int array
        Number of the place that was nearest to each when fibres were moved last, and is likely to be still;
        -1 where that is not known. Nothing but time depends on it.
    """

    samples: Floats
    low: Floats
    high: Floats
    volume: float
    guesses: Ints


def cloud(samples: Floats) -> Cloud:
    """Return positions (j, 3), j >= 1, and what is known of them."""
    # Those next to each other one after the other: what is looked up for them is at hand.
    cells = (samples - samples.min(axis=0)) * (_CELLS / max(float(np.ptp(samples, axis=0).max()), 1e-300))
    x, y, z = cells.astype(np.int64).T
    samples = samples[np.argsort((x * (_CELLS + 1) + y) * (_CELLS + 1) + z, kind="stable")]
    about = samples - samples.mean(axis=0)
    spread = about.T @ about / len(samples)
    volume = float(np.sqrt(12.0**3 * max(float(np.linalg.det(spread)), 0.0)))
    guesses = np.full(len(samples), -1)
    return Cloud(samples, samples.min(axis=0), samples.max(axis=0), volume, guesses)


def steps_to_centres(points: Floats, offsets: Ints, within: Cloud) -> Floats:
    """Return how each point of fibres has to move, for its fibre to be in the middle of its cell.

    Fibres move across themselves, not along, and as wholes rather than point by point: what a cell says is
    smoothed along the fibre. So those that are neighbours stay neighbours.

    Parameters
    ----------
    points : (n, 3) array
        Fibre points [mm].
    offsets : (k + 1,) int array
        First point of each fibre, and n.
    within : Cloud
        Positions in the muscle.

    Returns
    -------
    (n, 3) array
        Displacements [mm].
    """
    lines = _stations(points, offsets)
    return _between(points, offsets, _station_steps(lines, within))


@kernel
def move_ends(points: Floats, ends: Ints, others: Ints, places: Floats) -> None:
    """Move one end of each fibre to a given place, and what is beside it with it.

    A fibre that goes on while its end is held, at the rim of its area, hooks there. So the points beside it
    follow, the less the farther they are, up to :data:`REACH` of the fibre's points.

    Parameters
    ----------
    points : (n, 3) array
        Fibre points, changed in place [mm].
    ends, others : (k,) int arrays
        This end of each fibre, and its other one.
    places : (k, 3) array
        Where the ends go [mm].
    """
    for i in range(len(ends)):
        step, count = (1 if others[i] > ends[i] else -1), abs(others[i] - ends[i])
        for axis in range(3):
            way = places[i, axis] - points[ends[i], axis]
            points[ends[i], axis] = places[i, axis]
            for j in range(1, count):
                points[ends[i] + step * j, axis] += max(1.0 - j / (REACH * count), 0.0) * way


@array_kernel
def _stations(points: Floats, offsets: Ints) -> Floats:
    """Return places (k, STATIONS, 3) at equal distances along each fibre."""
    result = np.empty((len(offsets) - 1, STATIONS, 3))
    for i in range(len(result)):
        line = points[offsets[i] : offsets[i + 1]]
        places = resample_polyline(line, even_arcs(line, STATIONS))
        for station in range(STATIONS):
            for axis in range(3):
                result[i, station, axis] = places[station, axis]
    return result


@array_kernel
def _between(points: Floats, offsets: Ints, shifts: Floats) -> Floats:
    """Return what is given for places (k, STATIONS, 3) at equal distances along fibres, for their points."""
    result = np.zeros(points.shape)
    for i in range(len(offsets) - 1):
        first, last = offsets[i], offsets[i + 1]
        length = 0.0
        for j in range(first + 1, last):
            length += distance_between(points, j, j - 1)
        along = 0.0
        for j in range(first, last):
            if j > first:
                along += distance_between(points, j, j - 1)
            at = along / length * (STATIONS - 1) if length > 0.0 else 0.0
            station = min(int(at), STATIONS - 2)
            share = min(at - station, 1.0)
            for axis in range(3):
                result[j, axis] = (1.0 - share) * shifts[i, station, axis]
                result[j, axis] += share * shifts[i, station + 1, axis]
    return result


def _station_steps(lines: Floats, within: Cloud) -> Floats:
    """Return how far places (k, STATIONS, 3) of fibres are from the middle of their cells, across them."""
    low, high = within.low.copy(), within.high.copy()
    length = _measured(lines, low, high)
    extent, step = high - low, length / (len(lines) * (STATIONS - 1))
    # The space between fibres in the muscle.
    spacing = max(float(np.sqrt(within.volume / max(length, 1e-300))), 1e-300)
    pieces = int(np.clip(np.ceil(2.0 * step / spacing), 1, PIECES))
    size = max(spacing, float(extent.max()) / FINEST)
    shape = (extent / size).astype(np.int64) + 1
    places, order, offsets = _sorted_pieces(lines, pieces, low, size, shape)
    band = OVERLAP * spacing**2
    samples = within.samples, within.guesses
    pulls, weights = _pulls(lines, pieces, *samples, places, order, offsets, low, size, shape, band)
    wide = spacing / max(step, 1e-300)
    return _across(lines, pulls, weights, _blur(int(np.clip(2.0 * wide**2, LEAST_BLUR, 2 * STATIONS**2))))


@kernel
def _measured(lines: Floats, low: Floats, high: Floats) -> float:
    """Return the length of lines (k, STATIONS, 3) together, and widen a box (3,), (3,) for them [mm]."""
    total = 0.0
    for i in range(len(lines)):
        for j in range(lines.shape[1]):
            square = 0.0
            for axis in range(3):
                low[axis] = min(low[axis], lines[i, j, axis])
                high[axis] = max(high[axis], lines[i, j, axis])
                square += (lines[i, j, axis] - lines[i, max(j - 1, 0), axis]) ** 2
            total += np.sqrt(square)
    return total


@array_kernel
def _across(lines: Floats, pulls: Floats, weights: Floats, blur: Floats) -> Floats:
    """Return mean pulls (k, STATIONS, 3) of each place and its neighbours, without what is along the line."""
    last = lines.shape[1] - 1
    result = np.empty(lines.shape)
    for i in range(len(lines)):
        for j in range(last + 1):
            x, y, z, weight = 0.0, 0.0, 0.0, 0.0
            for k in range(last + 1):
                part = blur[j, k]
                x, y, z = x + part * pulls[i, k, 0], y + part * pulls[i, k, 1], z + part * pulls[i, k, 2]
                weight += part * weights[i, k]
            if weight > 0.0:
                x, y, z = x / weight, y / weight, z / weight
            before, after = lines[i, max(j - 1, 0)], lines[i, min(j + 1, last)]
            tx, ty, tz = after[0] - before[0], after[1] - before[1], after[2] - before[2]
            along = (x * tx + y * ty + z * tz) / max(tx * tx + ty * ty + tz * tz, 1e-300)
            result[i, j, 0], result[i, j, 1] = x - along * tx, y - along * ty
            result[i, j, 2] = z - along * tz
    return result


@lru_cache
def _blur(passes: int) -> Floats:
    """Return the matrix (STATIONS, STATIONS) that gives means of neighbours and keeps the sum."""
    once = 0.5 * np.eye(STATIONS) + 0.25 * (np.eye(STATIONS, k=1) + np.eye(STATIONS, k=-1))
    once[0, 0] = once[-1, -1] = 0.75
    blur: Floats = np.linalg.matrix_power(once, passes)
    return blur


@array_kernel
def _sorted_pieces(
    lines: Floats, pieces: int, low: Floats, size: float, shape: Ints
) -> tuple[Floats, Ints, Ints]:
    """Return places along fibres, their numbers by cells of a grid, and where each cell begins (offsets)."""
    n_lines, n = len(lines), (lines.shape[1] - 1) * pieces + 1
    cells, places = np.empty(n_lines * n, dtype=np.int64), np.empty((n_lines * n, 3))
    for number in range(n_lines * n):
        line, piece = number // n, number % n
        station = min(piece // pieces, lines.shape[1] - 2)
        share = piece / pieces - station
        cell = 0
        for axis in range(3):
            x = (1.0 - share) * lines[line, station, axis] + share * lines[line, station + 1, axis]
            places[number, axis] = x
            cell = cell * shape[axis] + min(int((x - low[axis]) / size), shape[axis] - 1)
        cells[number] = cell
    order, offsets = sorted_into_bins(cells, shape[0] * shape[1] * shape[2])
    return places, order, offsets


@kernel
def _square_to_a_near_one(
    x: float, y: float, z: float, places: Floats, offsets: Ints, low: Floats, size: float, shape: Ints
) -> float:
    """Return the squared distance from a position to a place: the nearest in the first shell that has any."""
    a = min(int((x - low[0]) / size), shape[0] - 1)
    b = min(int((y - low[1]) / size), shape[1] - 1)
    c = min(int((z - low[2]) / size), shape[2] - 1)
    least, reach = np.inf, 0
    while least == np.inf:
        for i in range(max(a - reach, 0), min(a + reach + 1, shape[0])):
            for j in range(max(b - reach, 0), min(b + reach + 1, shape[1])):
                row = (i * shape[1] + j) * shape[2]
                # Cells of a row are one after the other.
                first, last = offsets[row + max(c - reach, 0)], offsets[row + min(c + reach + 1, shape[2])]
                for at in range(first, last):
                    dx, dy, dz = places[at, 0] - x, places[at, 1] - y, places[at, 2] - z
                    least = min(least, dx * dx + dy * dy + dz * dz)
        reach += 1
    return least


@array_kernel
def _pulls(
    lines: Floats,
    pieces: int,
    samples: Floats,
    guesses: Ints,
    places: Floats,
    order: Ints,
    offsets: Ints,
    low: Floats,
    size: float,
    shape: Ints,
    band: float,
) -> tuple[Floats, Floats]:
    """Return sums of offsets (k, STATIONS, 3) of the samples that are nearest to each place, and how many.

    Places nearly as near, their squared distances within a band [mm^2] of the least, have a share in a
    sample, which is 0 at the end of the band.
    """
    n_lines, n_stations = lines.shape[0], lines.shape[1]
    n = (n_stations - 1) * pieces + 1
    in_cells, stations = np.empty((len(order), 3)), np.empty(len(order), dtype=np.int64)
    for at in range(len(order)):
        line, piece = order[at] // n, order[at] % n
        stations[at] = line * n_stations + min(piece // pieces, n_stations - 2)
        for axis in range(3):
            in_cells[at, axis] = places[order[at], axis]
    pulls, weights = np.zeros((n_lines, n_stations, 3)), np.zeros((n_lines, n_stations))
    near, shares = np.empty(len(order), dtype=np.int64), np.empty(len(order))
    nodes = lines.reshape(n_lines * n_stations, 3)
    sums = pulls.reshape(n_lines * n_stations, 3), weights.reshape(n_lines * n_stations)
    bins = in_cells, order, stations, offsets, low, size, shape
    _pull(nodes, samples, guesses, places, bins, band, near, shares, *sums)
    return pulls, weights


@kernel
def _pull(
    nodes: Floats,
    samples: Floats,
    guesses: Ints,
    places: Floats,
    bins: tuple[Floats, Ints, Ints, Ints, Floats, float, Ints],
    band: float,
    near: Ints,
    shares: Floats,
    pulls: Floats,
    weights: Floats,
) -> None:
    """Add to what :func:`_pulls` returns, by the number of the station before each place."""
    in_cells, order, stations, offsets, low, size, shape = bins
    lx, ly, lz = low[0], low[1], low[2]
    nx, ny, nz = shape[0], shape[1], shape[2]
    for number in range(len(samples)):
        x, y, z = samples[number, 0], samples[number, 1], samples[number, 2]
        guess = guesses[number]
        if 0 <= guess < len(places):
            dx, dy, dz = places[guess, 0] - x, places[guess, 1] - y, places[guess, 2] - z
            least = dx * dx + dy * dy + dz * dz
        else:
            least = _square_to_a_near_one(x, y, z, in_cells, offsets, low, size, shape)
        farthest = least * (1.0 + 1e-9) + max(band, 1e-300)  # farther than the nearest in any case
        reach = np.sqrt(farthest)
        first, last = max(int((z - reach - lz) / size), 0), min(int((z + reach - lz) / size), nz - 1)
        found = 0
        for i in range(max(int((x - reach - lx) / size), 0), min(int((x + reach - lx) / size), nx - 1) + 1):
            for j in range(
                max(int((y - reach - ly) / size), 0), min(int((y + reach - ly) / size), ny - 1) + 1
            ):
                row = (i * ny + j) * nz
                for at in range(offsets[row + first], offsets[row + last + 1]):
                    dx, dy, dz = in_cells[at, 0] - x, in_cells[at, 1] - y, in_cells[at, 2] - z
                    square = dx * dx + dy * dy + dz * dz
                    near[found], shares[found] = stations[at], square
                    found += 1 if square < farthest else 0
                    if square <= least:
                        least, guess = square, order[at]
        guesses[number] = guess
        farthest = least * (1.0 + 1e-9) + max(band, 1e-300)
        count, total = 0, 0.0
        for k in range(found):
            share = farthest - shares[k]
            if share > 0.0:
                near[count], shares[count] = near[k], share
                count += 1
                total += share
        for k in range(count):
            node = near[k]
            ax, ay, az = nodes[node, 0], nodes[node, 1], nodes[node, 2]
            bx, by, bz = nodes[node + 1, 0] - ax, nodes[node + 1, 1] - ay, nodes[node + 1, 2] - az
            squared = bx * bx + by * by + bz * bz
            along = (x - ax) * bx + (y - ay) * by + (z - az) * bz
            along = min(max(along / squared if squared > 0.0 else 0.0, 0.0), 1.0)
            before, after = (1.0 - along) * shares[k] / total, along * shares[k] / total
            weights[node] += before
            weights[node + 1] += after
            sx, sy, sz = x - (ax + along * bx), y - (ay + along * by), z - (az + along * bz)
            pulls[node, 0] += before * sx
            pulls[node, 1] += before * sy
            pulls[node, 2] += before * sz
            pulls[node + 1, 0] += after * sx
            pulls[node + 1, 1] += after * sy
            pulls[node + 1, 2] += after * sz
