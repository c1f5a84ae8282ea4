"""A muscle's surface at rest, and deviations of deformed shapes."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from vtkmuscle.core.jit import lane, vector_kernel
from vtkmuscle.core.mesh.surface import MeshTopology, check_volume, edge_lengths
from vtkmuscle.core.types import MOST_ROUNDS, ROUNDING, Bools, Floats, Ints

#: Largest height of a sliver, as a part of its length: a displacement as small turns the triangle over. A
#: ring as flat encloses nothing.
SLIVER = 1e-3
#: Least denominator of a volume projection, as a part of its rest value: a crushed muscle inflates over
#: several projections, not to infinity at once. No muscle of a hip, a knee or an arm reaches it.
VOLUME_FLOOR = 0.01


@vector_kernel
def volume_and_gradient(p: Floats, triangles: Ints, gradient: Floats) -> float:
    """Return the volume [mm^3], and write its gradient. Closed surface, gradient (n, 3) [mm^2].

    V = sum p1 . (p2 x p3) / 6 over the triangles. Of dV/dp1 = sum p2 x p3 / 6 the triangles around a point
    leave sum (p2 - p1) x (p3 - p1) / 6, as the surface is closed: the same vector for all three corners,
    independent of the origin. V is homogeneous of degree 3: V = sum p . dV/dp / 3.
    """
    gradient[:] = 0.0
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = p[i, 0], p[i, 1], p[i, 2]
        bx, by, bz = p[j, 0] - ax, p[j, 1] - ay, p[j, 2] - az
        cx, cy, cz = p[k, 0] - ax, p[k, 1] - ay, p[k, 2] - az
        x, y, z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        for corner in (i, j, k):
            gradient[corner, 0] += x
            gradient[corner, 1] += y
            gradient[corner, 2] += z
    total = 0.0
    for i in range(len(p)):  # about a point of the muscle: one far from the origin loses no digits
        for c in range(3):
            gradient[i, c] /= 6.0
            total += (p[i, c] - p[0, c]) * gradient[i, c]
    return total / 3.0


@vector_kernel
def project_volume(
    p: Floats, w: Floats, shares: Floats, triangles: Ints, rest: float, stiffness: float, floor: float,
    gradient: Floats,
) -> float:  # fmt: skip
    """Move points to the rest volume; return the volume before. To first order.

    p_i -= k w_i (V - V0) g_i / sum_j s_j |g_j|^2 (Müller, Heidelberger, Hennix, Ratcliff 2007, *Position
    based dynamics*, doi:10.1016/j.jvcir.2007.01.005, eq. 6-8, with the shares s = w). p : (n, 3), changed in
    place;  w, shares : (n,) inverse masses, 1 free, 0 fixed;  rest : V0 [mm^3]; stiffness : k, 0 to 1; floor
    : least denominator [mm^4];  gradient : (n, 3) working memory.
    """
    volume = volume_and_gradient(p, triangles, gradient)
    squares = 0.0
    for i in range(len(p)):
        x, y, z = gradient[i, 0], gradient[i, 1], gradient[i, 2]
        squares += shares[i] * (x * x + y * y + z * z)
    if squares > 0.0:
        s = stiffness * (volume - rest) / max(squares, floor)
        for i in range(len(p)):
            for axis in range(3):
                p[i, axis] -= s * w[i] * gradient[i, axis]
    return volume


@lane
def edge_geometry(
    x1: float, y1: float, z1: float,
    x2: float, y2: float, z2: float,
    x3: float, y3: float, z3: float,
    x4: float, y4: float, z4: float,
) -> tuple[Any, ...]:  # fmt: skip
    """Return the geometry of two triangles at a common edge.

    The triangles (p1, p2, p3) and (p2, p1, p4) share e = p2 - p1. The signed angle phi between their normals
    n1 = e x (p3 - p1) and n2 = (p4 - p1) x e has sin phi = (n1 x n2) . e / (|e| |n1| |n2|) and cos phi = n1 .
    n2 / (|n1| |n2|): 0 for a flat, positive for a convex edge. As n1 is normal to e, (n1 x n2) . e = -|e|^2
    n1 . (p4 - p1).

    Returns whether both triangles have a normal, by the tangent of the corner at p1; the sine and the cosine
    of phi, times |n1| |n2|; |e|^2, (p3 - p1) . e, (p4 - p1) . e; |n1|^2, |n2|^2; the normals n1, n2.
    """
    ex, ey, ez = x2 - x1, y2 - y1, z2 - z1
    ax, ay, az = x3 - x1, y3 - y1, z3 - z1
    bx, by, bz = x4 - x1, y4 - y1, z4 - z1
    n1x, n1y, n1z = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
    n2x, n2y, n2z = by * ez - bz * ey, bz * ex - bx * ez, bx * ey - by * ex
    ee = ex * ex + ey * ey + ez * ez
    ae = ax * ex + ay * ey + az * ez
    be = bx * ex + by * ey + bz * ez
    n11 = n1x * n1x + n1y * n1y + n1z * n1z
    n22 = n2x * n2x + n2y * n2y + n2z * n2z
    least = ROUNDING * ROUNDING
    proper = (n11 > least * (ae * ae)) & (n22 > least * (be * be)) & (n11 * n22 > 0.0)
    sine = -math.sqrt(ee) * (n1x * bx + n1y * by + n1z * bz)
    cosine = n1x * n2x + n1y * n2y + n1z * n2z
    return proper, sine, cosine, ee, ae, be, n11, n22, n1x, n1y, n1z, n2x, n2y, n2z


def dihedral_angles(points: Floats, quads: Ints) -> tuple[Floats, Bools]:
    """Return signed dihedral angles (q,) [radians], and their validity.

    0 for flat, positive for convex edges, in (-pi, pi]; see :func:`edge_geometry`. Quadruples (q, 4) as in
    :class:`~vtkmuscle.core.mesh.surface.MeshTopology`. An angle at a degenerate triangle is 0 and not valid.
    """
    sines, cosines, defined = *np.empty((2, len(quads))), np.empty(len(quads), dtype=np.bool_)
    _hinges(points, quads, sines, cosines, defined)
    angles: Floats = np.arctan2(sines, cosines)
    angles[angles == -np.pi] = np.pi
    return angles, defined


@vector_kernel
def _hinges(p: Floats, quads: Ints, sines: Floats, cosines: Floats, defined: Bools) -> None:
    for q in range(len(quads)):
        a, b, c, d = p[quads[q, 0]], p[quads[q, 1]], p[quads[q, 2]], p[quads[q, 3]]
        hinge = edge_geometry(a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2], d[0], d[1], d[2])
        defined[q] = hinge[0]
        sines[q], cosines[q] = (hinge[1], hinge[2]) if hinge[0] else (0.0, 1.0)


def beside_slivers(points: Floats, quads: Ints) -> Bools:
    """Return which quadruples (q, 4) have a sliver. Its angle is meaningless."""
    sliver = np.zeros(len(quads), dtype=np.bool_)
    for corners in (points[quads[:, :3]], points[quads[:, [0, 1, 3]]]):
        sides = np.roll(corners, -1, axis=1) - corners
        doubled = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
        sliver |= doubled < SLIVER * (sides**2).sum(axis=2).max(axis=1)
    return sliver


class ShapeReport(NamedTuple):
    """Deviations of a deformed surface from its rest shape."""

    volume_ratio: float  # V / V0
    edge_stretch_p95: float  # 95th percentile of l / l0 over all edges
    edge_stretch_max: float
    #: 95th percentile of the absolute change of the angles at edges without a sliver at rest [degrees].
    dihedral_error_p95: float
    degenerate_edges: int  # edges with an angle at rest, at a collapsed triangle


class RestShape:
    """Lengths, angles and volume of a closed surface at rest.

    Points (n, 3) [mm]. A ValueError says that the surface encloses no volume.
    """

    def __init__(self, points: Floats, topology: MeshTopology) -> None:
        self.points, self.topology = points, topology
        #: Of the edges, (k,) [mm].
        self.lengths: Floats = edge_lengths(points, topology.edges)
        long = self.lengths > 0
        self._long_edges = np.ascontiguousarray(topology.edges[long])
        self._long_lengths: Floats = self.lengths[long]
        #: Signed dihedral angles of the quadruples, (q,) [radians], and False beside degenerate triangles.
        self.angles, self.angle_defined = dihedral_angles(points, topology.quads)
        bent = self.angle_defined & ~beside_slivers(points, topology.quads)
        self._bent_quads = np.ascontiguousarray(topology.quads[bent])
        self._bent_angles: Floats = self.angles[bent]
        #: Volume [mm^3], and dV / dp, (n, 3) [mm^2].
        self.volume_gradient: Floats = np.empty_like(points)
        self.volume: float = volume_and_gradient(points, topology.triangles, self.volume_gradient)
        check_volume(points, self.volume)

    def compare(self, positions: Floats) -> ShapeReport:
        """Return the deviations of positions from rest. Positions (n, 3) [mm]."""
        stretch = edge_lengths(positions, self._long_edges) / self._long_lengths
        angles, defined = dihedral_angles(positions, self._bent_quads)
        turns = np.abs(angles - self._bent_angles)[defined]
        turns = np.minimum(turns, 2.0 * np.pi - turns)
        volume = volume_and_gradient(positions, self.topology.triangles, np.empty_like(positions))
        stretches = float(np.percentile(stretch, 95.0)), float(stretch.max())
        turned = float(np.degrees(np.percentile(turns, 95.0))) if len(turns) else 0.0
        return ShapeReport(volume / self.volume, *stretches, turned, len(defined) - len(turns))


class Volume:
    """Restores the volume of a muscle.

    shape : RestShape, the muscle at rest;
    free : (n,) bool, points that may be moved.
    """

    def __init__(self, shape: RestShape, free: Bools) -> None:
        self._triangles, self._rest = shape.topology.triangles, shape.volume
        self._mass: Floats = free.astype(np.float64)
        self._floor = VOLUME_FLOOR * float(self._mass @ np.linalg.norm(shape.volume_gradient, axis=1) ** 2)
        self._gradient: Floats = np.empty_like(shape.points)

    def restore(self, points: Floats, held: Bools | None = None) -> float:
        """Move points to the rest volume. Held points stay; return the relative error before."""
        mass = self._mass if held is None else np.where(held, 0.0, self._mass)
        rest = self._triangles, self._rest, 1.0, self._floor
        return abs(project_volume(points, mass, mass, *rest, self._gradient) / self._rest - 1.0)

    def finish(self, points: Floats, keep_out: Callable[[Floats], Bools]) -> Bools:
        """Take points out of the bones. Others give back the volume; return the held points."""
        held = np.zeros(len(points), dtype=np.bool_)
        for _ in range(MOST_ROUNDS):
            new = keep_out(points) & ~held
            held |= new
            off = self.restore(points, held)
            if not (new.any() or off > ROUNDING):
                break
        return held
