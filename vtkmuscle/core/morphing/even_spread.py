"""Points spread over a section as evenly as they are over the template's rectangle.

A one-to-one map of the rectangle to a section enlarges some parts more than others: a harmonic one leaves
narrow parts of the section next to none of the rectangle. Moving the points in the rectangle first makes up
for that: its x, such that equal steps are equal areas of the section, and then in strips across x its y
likewise (Rosenblatt 1952, doi:10.1214/aoms/1177729394). Both keep the order of the points.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Strips across x; more follow the section more closely, with fewer triangles in each.
N_STRIPS = 10
#: Places at which areas are summed up, as many along x as along y.
N_BREAKS = 64


@kernel
def spread_evenly(nodes: Floats, triangles: Ints, areas: Floats, points: Floats) -> Floats:
    """Return points of a rectangle moved such that a map of it spreads them evenly.

    Areas below a place are sums over triangles with their centres below it, of the section as of the
    rectangle: where the map enlarges all parts alike, the points stay as they are to the last digit.

    Parameters
    ----------
    nodes : (n, 2) array
        A triangulation of the rectangle, which has its corners.
    triangles : (t, 3) int array
        Its triangles.
    areas : (t,) array
        What area the map gives each of them, >= 0, not all 0.
    points : (m, 2) array
        Points of the rectangle.

    Returns
    -------
    (m, 2) array
        Points of the rectangle.
    """
    n = len(triangles)
    low, high, own = np.empty((n, 2)), np.empty((n, 2)), np.empty(n)
    for t in range(n):
        a, b, c = triangles[t]
        for axis in range(2):
            low[t, axis] = min(nodes[a, axis], nodes[b, axis], nodes[c, axis])
            high[t, axis] = max(nodes[a, axis], nodes[b, axis], nodes[c, axis])
        ux, uy = nodes[b, 0] - nodes[a, 0], nodes[b, 1] - nodes[a, 1]
        vx, vy = nodes[c, 0] - nodes[a, 0], nodes[c, 1] - nodes[a, 1]
        own[t] = 0.5 * abs(ux * vy - uy * vx)
    xs, ys = _breaks(low[:, 0], high[:, 0]), _breaks(low[:, 1], high[:, 1])
    shares = _shares_below(areas, low[:, 0], high[:, 0], xs)
    targets = np.interp(points[:, 0], xs, _shares_below(own, low[:, 0], high[:, 0], xs))
    borders = np.interp(np.arange(N_STRIPS + 1) / N_STRIPS, shares, xs)
    in_strips = np.empty((N_STRIPS, len(points)))
    for strip in range(N_STRIPS):
        mine = np.flatnonzero((high[:, 0] > borders[strip]) & (low[:, 0] < borders[strip + 1]))
        parts = np.empty(len(mine))
        for k in range(len(mine)):
            first, last = low[mine[k], 0], high[mine[k], 0]
            overlap = min(last, borders[strip + 1]) - max(first, borders[strip])
            parts[k] = overlap / (last - first)
        lower, upper = low[mine, 1], high[mine, 1]
        below = np.interp(points[:, 1], ys, _shares_below(parts * own[mine], lower, upper, ys))
        in_strips[strip] = np.interp(below, _shares_below(parts * areas[mine], lower, upper, ys), ys)
    result = np.empty_like(points)
    result[:, 0] = np.interp(targets, shares, xs)
    for p in range(len(points)):
        place = min(max(targets[p] * N_STRIPS - 0.5, 0.0), N_STRIPS - 1.0)
        first = min(int(place), N_STRIPS - 2)
        weight = place - first
        result[p, 1] = (1.0 - weight) * in_strips[first, p] + weight * in_strips[first + 1, p]
    return result


@kernel
def _breaks(low: Floats, high: Floats) -> Floats:
    """Return ascending places from the lowest to the highest, more of them where triangles are small."""
    centres = np.sort(low + high) / 2.0
    result = np.empty(N_BREAKS + 1)
    for k in range(N_BREAKS + 1):
        result[k] = centres[int((len(centres) - 1) * k / N_BREAKS)]
    result[0], result[-1] = low.min(), high.max()
    return result


@kernel
def _shares_below(areas: Floats, low: Floats, high: Floats, breaks: Floats) -> Floats:
    """Return which part of the area is below each of some places, each triangle's spread over its extent."""
    total = 0.0
    sums = np.zeros(len(breaks))
    for t in range(len(areas)):
        total += areas[t]
        extent = high[t] - low[t]
        first = np.searchsorted(breaks, low[t], side="right")
        for k in range(first, len(breaks)):
            if breaks[k] >= high[t]:
                sums[k] += areas[t]  # and of all the places above, below
                break
            share = areas[t] * (breaks[k] - low[t]) / extent
            sums[k] += share
            if k + 1 < len(breaks):
                sums[k + 1] -= share
    # Each place has what was added from it on.
    for k in range(1, len(breaks)):
        sums[k] += sums[k - 1]
    sums[0], sums[-1] = 0.0, total
    return sums / total if total > 0.0 else (breaks - breaks[0]) / (breaks[-1] - breaks[0])
