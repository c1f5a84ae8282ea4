"""Smooth solids as implicit fields, blended and cut.

A field is negative inside, zero on the surface, and nowhere steeper than a distance.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline
from scipy.spatial import cKDTree

from vtkmuscle.core.types import Floats

#: Farther than this from the box of a curve or sheet [mm], the distance to the box stands for its field.
REACH = 16.0


@dataclass(frozen=True, eq=False)
class Solid:
    """A field from points (n, 3) to values (n,) and gradients (n, 3), and a box around its solid [mm]."""

    field: Callable[[Floats], tuple[Floats, Floats]]
    lower: Floats
    upper: Floats

    def values(self, points: Floats) -> Floats:
        """Return the field at points: negative inside, at most the distance outside [mm]."""
        return self.field(points)[0]

    def joined(self, other: "Solid", blend: float) -> "Solid":
        """Return the union with a solid, the crease filled over ``blend`` [mm]."""
        box = np.minimum(self.lower, other.lower), np.maximum(self.upper, other.upper)
        return Solid(lambda x: smooth_minimum(self.field(x), other.field(x), blend), *box)

    def without(self, other: "Solid", blend: float, gap: float = 0.0) -> "Solid":
        """Return the solid minus another, grown by ``gap``, with a rim of ``blend`` [mm]."""

        def field(points: Floats) -> tuple[Floats, Floats]:
            value, slope = self.field(points)
            cut, cut_slope = other.field(points)
            value, slope = smooth_minimum((-value, -slope), (cut - gap, cut_slope), blend)
            return -value, -slope

        return Solid(field, self.lower, self.upper)

    def cut_by(self, centre: ArrayLike, normal: ArrayLike, blend: float) -> "Solid":
        """Return the part against a plane's normal, with a rim of ``blend`` [mm]."""
        c, n = _vector(centre), _vector(normal)
        n = n / np.linalg.norm(n)
        box = self.lower, self.upper
        return self.without(Solid(lambda x: ((c - x) @ n, np.tile(-n, (len(x), 1))), *box), blend)

    def projected(self, points: Floats, *, steps: int = 3) -> Floats:
        """Return points moved onto the surface by Newton steps along the gradient."""
        for _ in range(steps):
            value, slope = self.field(points)
            squared = np.maximum(np.einsum("ij,ij->i", slope, slope), 0.04)
            points = points - (value / squared)[:, None] * slope
        return points


def smooth_minimum(
    first: tuple[Floats, Floats], second: tuple[Floats, Floats], blend: float
) -> tuple[Floats, Floats]:
    """Return the minimum of two fields, rounded where they differ by less than ``blend`` [mm].

    min(a, b) - max(k - |a - b|, 0)^2 / 4k: the quadratic form of I. Quilez,
    https://iquilezles.org/articles/smin/, once differentiable.
    """
    (a, slope_a), (b, slope_b) = first, second
    overlap = np.maximum(1.0 - np.abs(a - b) / blend, 0.0) if blend > 0 else np.zeros_like(a)
    share = np.where(a < b, overlap / 2.0, 1.0 - overlap / 2.0)[:, None]
    value: Floats = np.minimum(a, b) - blend * overlap * overlap / 4.0
    return value, (1.0 - share) * slope_a + share * slope_b


def union(solids: Sequence[Solid], blend: float) -> Solid:
    """Return the union of solids, blended in turn [mm]."""
    return reduce(lambda first, second: first.joined(second, blend), solids)


def ball(centre: ArrayLike, radius: float) -> Solid:
    """Return a ball [mm]."""
    c = _vector(centre)
    return Solid(lambda points: _distance(points - c, radius), c - radius, c + radius)


def rod(start: ArrayLike, end: ArrayLike, radius: float, *, rim: float = 1.0) -> Solid:
    """Return a cylinder with flat ends, edges rounded over ``rim`` [mm]."""
    a, b = _vector(start), _vector(end)
    axis = (b - a) / np.linalg.norm(b - a)
    return thick_curve([a, b], [radius, radius]).cut_by(a, -axis, rim).cut_by(b, axis, rim)


def thick_curve(knots: ArrayLike, radii: ArrayLike, *, spacing: float = 3.0) -> Solid:
    """Return a tube about a smooth curve.

    The union of balls at knots (k, 3), k >= 2, and between, with radii (k,), every ``spacing`` mm.
    """
    return _thickened(np.column_stack([_vector(knots), _vector(radii)])[:, None], spacing)


def thick_sheet(knots: ArrayLike, half_thickness: ArrayLike, *, spacing: float = 3.0) -> Solid:
    """Return the solid about a smooth sheet.

    The union of balls at a net of knots (k, l, 3), k, l >= 2, and between, of radius ``half_thickness``
    (k, l), every ``spacing`` mm.
    """
    return _thickened(np.dstack([_vector(knots), _vector(half_thickness)]), spacing)


def spline_net(nodes: Floats, rows: ArrayLike, columns: ArrayLike) -> Floats:
    """Return a net (a, b, c) by cubic splines. Rows (a,) and columns (b,) are from 0 to 1."""
    for axis, parameters in ((0, rows), (1, columns)):
        count = nodes.shape[axis]
        if count > 1:
            spline = make_interp_spline(np.linspace(0, 1, count), nodes, k=min(3, count - 1), axis=axis)
            nodes = spline(_vector(parameters))
    return nodes


def _thickened(nodes: Floats, spacing: float) -> Solid:
    """Return the union of the balls on a net.

    The net is of (x, y, z, radius), a single column wide for a curve. The deciding ball has the least power
    |p - c|^2 - r^2. With w^2 = R^2 - r^2, R above all radii, the deciding (c, w) is the nearest to (p, 0) in
    four dimensions: a search tree finds the ball.
    """
    counts = [_sample_count(nodes, axis, spacing) for axis in (0, 1)]
    samples = spline_net(nodes, *(np.linspace(0, 1, count) for count in counts))
    radii = samples[..., 3].copy()
    lifted_radius = 1.25 * float(radii.max())
    samples[..., 3] = np.sqrt(lifted_radius**2 - radii**2)
    # Each sample stands for the flat piece of the net around it: up to half way to its neighbours.
    steps = [np.gradient(samples, axis=axis) if counts[axis] > 1 else 0.0 * samples for axis in (0, 1)]
    tangents = np.stack(steps, axis=-1).reshape(-1, 4, 2)
    inverses = np.linalg.pinv(tangents)
    index = np.stack(np.meshgrid(*(np.arange(count) for count in counts), indexing="ij"), axis=-1)
    low = np.where(index == 0, 0.0, -0.6).reshape(-1, 2)
    high = np.where(index == np.array(counts) - 1, 0.0, 0.6).reshape(-1, 2)
    centres = samples.reshape(-1, 4)
    lower = (centres[:, :3] - radii.reshape(-1, 1)).min(axis=0)
    upper = (centres[:, :3] + radii.reshape(-1, 1)).max(axis=0)
    tree = cKDTree(centres)

    def field(points: Floats) -> tuple[Floats, Floats]:
        value, slope = _distance(points - np.clip(points, lower, upper), 0.0)
        near = np.flatnonzero(value < REACH)
        lifted = np.column_stack([points[near], np.zeros(len(near))])
        i = tree.query(lifted)[1]
        away = lifted - centres[i]
        local = np.clip(np.einsum("nij,nj->ni", inverses[i], away), low[i], high[i])
        away -= np.einsum("nij,nj->ni", tangents[i], local)
        radius = np.sqrt(np.maximum(lifted_radius**2 - away[:, 3] ** 2, 0.0))
        value[near], slope[near] = _distance(away[:, :3], radius)
        return value, slope

    return Solid(field, lower, upper)


def _distance(away: Floats, radius: float | Floats) -> tuple[Floats, Floats]:
    lengths = np.linalg.norm(away, axis=1)
    return lengths - radius, away / np.maximum(lengths, 1e-12)[:, None]


def _sample_count(nodes: Floats, axis: int, spacing: float) -> int:
    if nodes.shape[axis] == 1:
        return 1
    lengths = np.linalg.norm(np.diff(nodes[..., :3], axis=axis), axis=-1).sum(axis=axis)
    return max(2 * int(nodes.shape[axis]), int(np.ceil(lengths.max() / spacing)) + 1)


def _vector(value: ArrayLike) -> Floats:
    return np.asarray(value, dtype=np.float64)
