"""Polylines: lengths, positions, segments. Points (n, 3) and offsets (k + 1,)."""

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import angles_between, unit_vectors
from vtkmuscle.core.types import TINY, Floats, Ints


def polyline_lengths(points: Floats, offsets: Ints) -> Floats:
    """Return the length of each polyline, (k,). In the unit of the points."""
    return np.add.reduceat(segment_lengths(points, offsets)[0], offsets[:-1])


#: Cosine of the least turn of a corner, 30 degrees; smaller turns belong to a curve. With 15 and 60 degrees
#: mean pennations of four muscles of a hip and a knee change by at most 1.1 and 0.5 degrees.
CORNER = 0.5 * 3.0**0.5


def smooth_polylines(points: Floats, offsets: Ints, k: float = 4.0, iterations: int = 1) -> Floats:
    """Return smoothed polylines, end points kept.

    p'_i = (p_{i-1} + k p_i + p_{i+1}) / (k + 2), all points of a pass at once: Kohout et al. 2012, *Muscle
    Fibres Modelling*, section 3.4, with k = 4. Points (n, 3) may be rows of other values; k is >= 0. A pass
    shrinks each sine wave of a line about its chord, and many passes are one power.
    """
    result, counts = points.copy(), np.diff(offsets)
    if iterations == 1:
        i = inner_points(offsets)
        result[i] = (points[i - 1] + k * points[i] + points[i + 1]) / (k + 2.0)
    elif iterations > 1:
        from scipy.fft import dst, idst  # noqa: PLC0415 -- 14 ms, and fibres of 15 segments need none

        for count in np.unique(counts[counts > 2]):
            rows = offsets[:-1][counts == count, None] + np.arange(count)
            lines, share = points[rows], np.linspace(0.0, 1.0, count)[1:-1, None]
            chords = (1.0 - share) * lines[:, :1] + share * lines[:, -1:]
            kept = (k + 2.0 * np.cos(np.pi * share)) / (k + 2.0)
            waves = kept**iterations * dst(lines[:, 1:-1] - chords, type=1, axis=1)
            result[rows[:, 1:-1]] = chords + idst(waves, type=1, axis=1)
    return result


def inner_points(offsets: Ints) -> Ints:
    """Return the indices of polyline points except ends."""
    inner = np.ones(offsets[-1], dtype=np.bool_)
    inner[offsets[:-1]] = inner[offsets[1:] - 1] = False
    return np.flatnonzero(inner)


def points_at_arcs(points: Floats, offsets: Ints, arcs: Floats) -> Floats:
    """Return points of polylines at arc lengths. Points (m, k, 3), arcs (m, k).

    Arc lengths count from the first point of each line; beyond a line they give its ends. A line has a point.
    """
    lengths, along = segment_lengths(points, offsets)
    firsts, wanted = offsets[:-1, None], arcs + along[offsets[:-1], None]
    after = np.searchsorted(along, wanted).clip(firsts + 1, offsets[1:, None] - 1)
    before = np.maximum(after - 1, firsts)
    whole = lengths[after]
    share = np.divide(wanted - along[before], whole, out=np.zeros(arcs.shape), where=whole > 0.0)
    share = share.clip(0.0, 1.0)[..., None]
    # In this form shares of 0 and 1 give the end points bit for bit.
    return np.asarray((1.0 - share) * points[before] + share * points[after])


def segment_lengths(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return segment lengths (n,) before points, 0 at first points of lines, and running sums."""
    lengths = np.zeros(len(points))
    lengths[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1)
    lengths[offsets[:-1]] = 0.0  # the step from one line to the next belongs to neither
    return lengths, np.cumsum(lengths)


def evenly_spaced(points: Floats, offsets: Ints, count: int) -> Floats:
    """Return equidistant points per polyline, ends kept. Result (m, count, 3), count >= 2."""
    arcs = np.linspace(0.0, polyline_lengths(points, offsets), count, axis=1)
    spaced = points_at_arcs(points, offsets, arcs)
    spaced[:, 0], spaced[:, -1] = points[offsets[:-1]], points[offsets[1:] - 1]
    return spaced


def evenly_spread(points: Floats, offsets: Ints, count: int) -> Floats:
    """Return equidistant points along smooth curves through polylines.

    The result is (m, count, 3), count >= 2, with the ends of the polylines. On a polyline's chords a fibre of
    15 segments wound round a cylinder would be 2 % too near to the cylinder's axis. The curves are cubic,
    with the slopes of parabolas through three points each; points that repeat count once.
    """
    distinct = np.append(True, np.diff(points, axis=0).any(axis=1))
    distinct[offsets[:-1]] = True
    points, offsets = points[distinct], np.append(0, np.cumsum(distinct))[offsets]
    lengths, along = segment_lengths(points, offsets)
    firsts, lasts, last = offsets[:-1], offsets[1:] - 1, len(points) - 1
    before, after = lengths[:, None], np.append(lengths[1:], 0.0)[:, None]
    onward = np.diff(points, axis=0, append=0.0)
    onward[lasts] = 0.0
    onward /= np.maximum(after, TINY)
    slopes = (after * np.roll(onward, 1, axis=0) + before * onward) / np.maximum(before + after, TINY)
    slopes[lasts] = onward[lasts - 1]
    slopes[firsts] = 2.0 * onward[firsts] - slopes[np.minimum(firsts + 1, last)]
    slopes[lasts] = 2.0 * onward[lasts - 1] - slopes[lasts - 1]

    def curve(places: Floats) -> Floats:
        i = np.searchsorted(along, places, side="right").clip(firsts[:, None] + 1, lasts[:, None])
        step, i = lengths[i][..., None], np.maximum(i - 1, firsts[:, None])
        part = ((places - along[i])[..., None] / np.maximum(step, TINY)).clip(0.0, 1.0)
        bend = (1.0 - part) * slopes[i] - part * slopes[np.minimum(i + 1, last)]
        ahead = part * (3.0 - 2.0 * part) * onward[i] + (1.0 - part) * bend
        return np.asarray(points[i] + step * part * ahead)

    places = np.linspace(along[firsts], along[lasts], count, axis=1)
    for _ in range(2):
        steps = np.linalg.norm(np.diff(curve(places), axis=1, prepend=points[firsts, None]), axis=2)
        arcs = np.cumsum(steps).reshape(places.shape)
        even = np.linspace(arcs[:, 0], arcs[:, -1], count, axis=1)
        places = np.interp(even, arcs.reshape(-1), places.reshape(-1))
    spread = curve(places)
    spread[:, 0], spread[:, -1] = points[firsts], points[lasts]
    return spread


def stations_of(points: Floats, offsets: Ints, count: int) -> tuple[Ints, Ints, Floats]:
    """Return each point's line, the station before, and the part of the way to the next, (n,) each.

    The stations, `count` >= 2 of a line, are as far apart as those of :func:`evenly_spaced`.
    """
    along, counts = segment_lengths(points, offsets)[1], np.diff(offsets)
    line, begins = np.repeat(np.arange(len(counts)), counts), along[offsets[:-1]]
    lengths = (along[offsets[1:] - 1] - begins)[line]
    at = np.divide(along - begins[line], lengths, out=np.zeros(len(points)), where=lengths > 0.0)
    at *= count - 1
    station = np.minimum(at.astype(np.int64), count - 2)
    return line, station, np.minimum(at - station, 1.0)


def end_directions(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return unit tangents (m, 3) at first and last points.

    The tangent of the parabola through the end and the next two points, by arc length; a segment is a chord,
    which differs from the end tangent by half its turn. The second segment counts less the sharper the turn;
    beyond a corner of 30 degrees only the last segment counts. Segments of length 0 do not count; a line
    without length gives 0.
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    lengths[offsets[1:-1] - 1] = 0.0  # from a line to the next
    proper = np.flatnonzero(lengths)
    directions, lengths = steps[proper] / lengths[proper, None], lengths[proper]
    line = np.searchsorted(offsets, proper, side="right") - 1
    tangents = np.zeros((2, len(offsets) - 1, 3))
    for tangent, inward in zip(tangents, (1, -1), strict=True):
        own, index = np.unique(line[::inward], return_index=True)
        first = index if inward == 1 else len(line) - 1 - index
        second = np.clip(first + inward, 0, len(line) - 1)
        cosines = (directions[first] * directions[second]).sum(axis=1)
        smooth = np.where(line[second] == own, np.maximum((cosines - CORNER) / (1.0 - CORNER), 0.0), 0.0)
        smooth *= lengths[first] / (lengths[first] + lengths[second])
        tangent[own] = directions[first] + smooth[:, None] * (directions[first] - directions[second])
    return unit_vectors(tangents[0]), unit_vectors(tangents[1])


def curve_segments(curves: Floats) -> tuple[Floats, Floats, Floats]:
    """Return start arcs, lengths and unit directions of segments. Curves (..., n, 3)."""
    steps = np.diff(curves, axis=-2)
    lengths = np.linalg.norm(steps, axis=-1)
    return np.cumsum(lengths, axis=-1) - lengths, lengths, unit_vectors(steps)


def nearest_arcs(curves: Floats, positions: Floats) -> tuple[Floats, Ints]:
    """Return arcs and segments (...) of curves (..., n, 3) nearest to positions (..., 3).

    The end segments are prolonged; arcs before the first point are negative.
    """
    starts, lengths, ahead = curve_segments(curves)
    since = positions[..., None, :] - curves[..., :-1, :]
    low, high = np.zeros(lengths.shape[-1]), lengths.copy()
    low[0], high[..., -1] = -np.inf, np.inf
    part = np.clip((since * ahead).sum(axis=-1), low, high)
    segments = ((since - part[..., None] * ahead) ** 2).sum(axis=-1).argmin(axis=-1)
    return np.take_along_axis(starts + part, segments[..., None], axis=-1)[..., 0], segments


def segments(points: Floats, offsets: Ints) -> tuple[Floats, Floats]:
    """Return both ends (s, 3) of all segments of polylines."""
    starts = np.setdiff1d(np.arange(len(points) - 1), offsets[1:-1] - 1)
    return points[starts], points[starts + 1]


def proper_segments(points: Floats, offsets: Ints) -> tuple[Ints, Floats, Floats]:
    """Return first points, steps (s, 3) and lengths (s,) > 0 of segments; at least one segment."""
    lengths = segment_lengths(points, offsets)[0][1:]
    starts = np.flatnonzero(lengths)
    if not len(starts):
        raise InputError("", "all fibres have length 0, so there is no direction")
    return starts, points[starts + 1] - points[starts], lengths[starts]


def segment_distances(points: Floats, a: Floats, b: Floats) -> Floats:
    """Return distances (...) of points from segments a to b. Segments may have no length."""
    along = b - a
    squares = np.einsum("...i,...i->...", along, along)
    dots = np.einsum("...i,...i->...", points - a, along)
    t = np.clip(np.divide(dots, squares, out=np.zeros_like(dots), where=squares > 0), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - a - t[..., None] * along, axis=-1))


#: Part of a path on either side of a turn, and the turn [degrees]: a taut path is straight where no bone
#: presses. In nine muscles of a hip, an arm and a leg up to 20 % of the paths turn so round bones or tissue,
#: by 30 degrees nearly all and by 90 none; 72 % over a fifth of the path, 2 % over a twentieth.
TURNED_PART, TURNED = 0.1, 60.0
#: Stations of a polyline in such a part, and in all.
_STEP, _PARTS = 4, 41


def _turns_of_parts(lines: Floats) -> Floats:
    """Return the turns between a tenth and the next [degrees]. Of stations (k, n, 3), (k, m)."""
    chords = unit_vectors(lines[:, _STEP:] - lines[:, :-_STEP])
    return angles_between(chords[:, :-_STEP], chords[:, _STEP:])


def hooks(points: Floats, offsets: Ints) -> float:
    """Return the part of polylines that turn sharply against their mean course."""
    lines = evenly_spaced(points, offsets, _PARTS)
    against = _turns_of_parts(lines) - _turns_of_parts(lines.mean(axis=0, keepdims=True))
    return float((against.max(axis=1) > TURNED).mean())


def sharp_turns(paths: Floats) -> tuple[Ints, Floats, Floats]:
    """Return positions of paths (k, n, 3) at which they turn sharply.

    Their paths (t,), positions (t, 3) and distances (t,) [mm] within which a bone may press. The turn is
    between the chords of a tenth of the path before and after.
    """
    points, offsets = paths.reshape(-1, 3), np.arange(len(paths) + 1) * paths.shape[1]
    lines = evenly_spaced(points, offsets, _PARTS)
    path, station = np.nonzero(_turns_of_parts(lines) > TURNED)
    return path, lines[path, station + _STEP], (0.5 * TURNED_PART * polyline_lengths(points, offsets))[path]
