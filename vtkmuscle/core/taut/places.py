"""Kernels of places: points moved, and the nearest ones on polylines."""

from __future__ import annotations

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.types import Floats


@kernel
def apply(transform: Floats, point: Floats, moved: Floats) -> None:
    """Write a point (3,) moved by a 4 x 4 transform."""
    x, y, z = point[0], point[1], point[2]
    for q in range(3):
        moved[q] = transform[q, 0] * x + transform[q, 1] * y + transform[q, 2] * z + transform[q, 3]


@kernel
def turn_back(transform: Floats, direction: Floats, turned: Floats) -> None:
    """Write a direction (3,) turned back by the rotation of a rigid transform."""
    x, y, z = direction[0], direction[1], direction[2]
    for q in range(3):
        turned[q] = transform[0, q] * x + transform[1, q] * y + transform[2, q] * z


@kernel
def value_along(values: Floats, at: float) -> tuple[float, float]:
    """Return the quadratic B-spline of values (n,) at a place between 0 and n - 1, and its slope.

    Unlike straight lines between the values it has no kinks, in which a string would go to and fro.
    """
    n = len(values)
    m = min(int(at + 0.5), n - 1)
    t = at - m
    a, b, c = values[max(m - 1, 0)], values[m], values[min(m + 1, n - 1)]
    value = 0.5 * (0.5 - t) ** 2 * a + (0.75 - t * t) * b + 0.5 * (0.5 + t) ** 2 * c
    return value, (t - 0.5) * a - 2.0 * t * b + (0.5 + t) * c


@kernel
def nearest_segment(track: Floats, u: Floats, start: int) -> int:
    """Return the segment of a polyline (n, 3) that a point is nearest to, going downhill from one on."""
    last = len(track) - 2
    j = start
    best = _distance2(track[j], track[j + 1], u)
    while j < last:
        ahead = _distance2(track[j + 1], track[j + 2], u)
        if not ahead < best:
            break
        j, best = j + 1, ahead
    while j > 0:
        behind = _distance2(track[j - 1], track[j], u)
        if not behind < best:
            break
        j, best = j - 1, behind
    return j


@kernel
def part_of_segment(a: Floats, b: Floats, u: Floats) -> float:
    """Return how far along a segment the place nearest to a point is, in [0, 1]."""
    lx, ly, lz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    ahead = (u[0] - a[0]) * lx + (u[1] - a[1]) * ly + (u[2] - a[2]) * lz
    length2 = lx * lx + ly * ly + lz * lz
    return min(max(ahead / length2, 0.0), 1.0) if length2 > 0.0 else 0.0


@kernel
def _distance2(a: Floats, b: Floats, u: Floats) -> float:
    """Return the squared distance of a point from a segment."""
    lx, ly, lz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    px, py, pz = u[0] - a[0], u[1] - a[1], u[2] - a[2]
    part = part_of_segment(a, b, u)
    px, py, pz = px - part * lx, py - part * ly, pz - part * lz
    squared: float = px * px + py * py + pz * pz
    return squared
