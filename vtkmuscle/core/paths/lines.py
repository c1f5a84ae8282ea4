"""Bones at the ends of fibres, and lines over the surface that stand in for fibres."""

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
    slope = (height[both[:, 1]] - height[both[:, 0]]) / np.maximum(length, np.finfo(float).tiny)
    # Of equally steep edges the one to the last point counts, whatever rounding says.
    steps = np.round(slope / (ROUNDING * max(slope.max(), np.finfo(float).tiny)))
    order = np.lexsort((both[:, 1], steps, both[:, 0]))
    steepest = order[np.append(np.diff(both[order, 0]) > 0, True)]  # the last of each point
    onward = np.arange(len(points))
    rising = steepest[(slope[steepest] > 0) & (fixed_to[both[steepest, 0]] < 0)]
    onward[both[rising, 0]] = both[rising, 1]
    return onward
