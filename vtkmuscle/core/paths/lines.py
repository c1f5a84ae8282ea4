"""Fibres as evenly spread points for paths, or lines over the surface."""

from itertools import pairwise

import numpy as np
from scipy.spatial import cKDTree

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.harmonic import harmonic_field
from vtkmuscle.core.mesh.polylines import smooth_polylines
from vtkmuscle.core.mesh.surface import MeshTopology
from vtkmuscle.core.types import ROUNDING, Floats, Ints

#: Lines that stand in for fibres, about: 16 phantoms come to rest with 32, and with 64 all but two.
STAND_INS = 32

#: Passes of averaging that take the zigzag of a mesh's edges out of a line. With half and twice of them mean
#: errors of three phantoms in lengths and levers are 4.0 and 3.3 mm instead of 3.6.
_PASSES = 10

#: What is no length at all is divided by this instead.
_TINY = np.finfo(float).tiny


def evenly_spread(points: Floats, offsets: Ints, count: int) -> Floats:
    """Return ``count`` evenly spread points along each polyline.

    Points lie on a smooth curve through the polyline, (f, count, 3). On a polyline's chords a fibre of 15
    segments wound round a cylinder would be 2 % too near to the cylinder's axis. The curves are cubic, with
    the slopes of parabolas through three points each. First and last points are the polyline's end points:
    ``points`` (p, 3) [mm], from each of ``offsets`` (f + 1,) to the next.
    """
    return np.array([_evenly_spread(points[begin:end], count) for begin, end in pairwise(offsets)])


def _evenly_spread(line: Floats, count: int) -> Floats:
    """Return points along the curve through a polyline (n, 3); repeated points count once."""
    line = line[np.append(True, np.diff(line, axis=0).any(axis=1))]
    if len(line) == 1:
        return np.repeat(line, count, axis=0)
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    slopes, at = np.diff(line, axis=0) / np.maximum(steps, _TINY)[:, None], np.append(0.0, np.cumsum(steps))
    tangents = np.repeat(slopes[:1], len(line), axis=0)
    if len(line) > 2:
        weighted = steps[1:, None] * slopes[:-1] + steps[:-1, None] * slopes[1:]
        tangents[1:-1] = weighted / np.maximum(steps[1:] + steps[:-1], _TINY)[:, None]
        tangents[[0, -1]] = 2.0 * slopes[[0, -1]] - tangents[[1, -2]]

    def curve(places: Floats) -> Floats:
        first = np.searchsorted(at[1:-1], places, side="right")
        part = ((places - at[first]) / np.maximum(np.diff(at)[first], _TINY))[:, None]
        along_chord = part * part * (3.0 - 2.0 * part) * (line[first + 1] - line[first])
        bend = part * (1.0 - part) * ((1.0 - part) * tangents[first] - part * tangents[first + 1])
        return np.asarray(line[first] + along_chord + steps[first, None] * bend)

    places = np.linspace(0.0, at[-1], count)
    for _ in range(2):
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(curve(places), axis=0), axis=1)))
        even = np.linspace(0.0, along[-1], count)
        first = np.searchsorted(along[1:-1], even, side="right")
        part = (even - along[first]) / np.maximum(np.diff(along)[first], _TINY)
        places = places[first] + part * np.diff(places)[first]
    spread = curve(places)
    spread[[0, -1]] = line[[0, -1]]
    return spread


def bones_at_ends(fibres: Floats, points: Floats, fixed_to: Ints) -> tuple[Ints, Ints]:
    """Return the bones at both ends of fibres.

    Each end (f,) gets the bone of the nearest fixed point; fibres are (f, n, 3). ``points`` (v, 3) is the
    muscle's surface, ``fixed_to`` (v,) the bone of each point, -1 for free points.
    """
    fixed = np.flatnonzero(fixed_to >= 0)
    tree = cKDTree(points[fixed])
    first, last = (fixed_to[fixed[tree.query(fibres[:, end])[1]]] for end in (0, -1))
    return first, last


def lines_on_surface(points: Floats, topology: MeshTopology, fixed_to: Ints) -> tuple[Floats, Ints] | None:
    """Return lines over a muscle from bone to bone.

    The lines serve a muscle without fibres. A harmonic function runs between the points fixed to different
    bones. The lines follow the function's steepest ascent and descent, along edges, through points spread
    over the surface, and are smoothed. ``points`` (v, 3) is the muscle at rest [mm], ``fixed_to`` (v,) the
    bone of each point, -1 for free points.

    Returns the points (p, 3) of all lines, line after line [mm], and the first point of each, and p, (f +
    1,); None where fewer than two bones have fixed points. ValueError if no line leads from bone to bone.
    """
    field = harmonic_field(points, topology.triangles, fixed_to)
    if field is None:
        return None
    down, up = (_steepest(points, topology.edges, sign * field, fixed_to) for sign in (-1.0, 1.0))
    free = np.flatnonzero(fixed_to < 0)
    # Of points on one line each would give it again.
    seeds = free[:: max(1, len(free) // STAND_INS)]
    chains = {(*reversed(_walk(seed, down)), *_walk(seed, up)[1:]): None for seed in seeds}
    lines = [points[list(c)] for c in chains if len(c) > 2 and fixed_to[[c[0], c[-1]]].min() >= 0]
    if not lines:
        raise InputError("", "no line over the surface leads from bone to bone", "connect fibres")
    offsets = np.cumsum([0, *map(len, lines)])
    return smooth_polylines(np.concatenate(lines), offsets, 2.0, _PASSES), offsets


def _walk(seed: int, onward: Ints) -> list[int]:
    chain = [int(seed)]
    while onward[chain[-1]] != chain[-1]:
        chain.append(int(onward[chain[-1]]))
    return chain


def _steepest(points: Floats, edges: Ints, height: Floats, fixed_to: Ints) -> Ints:
    """Return each point's neighbour up the steepest edge. Fixed points and summits stay."""
    both = np.vstack([edges, edges[:, ::-1]])
    length = np.linalg.norm(points[both[:, 1]] - points[both[:, 0]], axis=1)
    slope = (height[both[:, 1]] - height[both[:, 0]]) / np.maximum(length, _TINY)
    # Of equally steep edges the one to the last point counts, whatever rounding says.
    steps = np.round(slope / (ROUNDING * max(slope.max(), _TINY)))
    order = np.lexsort((both[:, 1], steps, both[:, 0]))
    steepest = order[np.append(np.diff(both[order, 0]) > 0, True)]  # the last of each point
    onward = np.arange(len(points))
    rising = steepest[(slope[steepest] > 0) & (fixed_to[both[steepest, 0]] < 0)]
    onward[both[rising, 0]] = both[rising, 1]
    return onward
