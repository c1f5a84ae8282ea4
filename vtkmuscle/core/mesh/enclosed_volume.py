"""The volume inside a closed surface, its gradient, the displacement that restores it; with edges halved."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import vector_kernel
from vtkmuscle.core.mesh.normals import vertex_normals
from vtkmuscle.core.mesh.surface import numbered_edges, signed_volume
from vtkmuscle.core.types import Floats, Ints

#: A volume projection's denominator is at least this part of its value at rest, so that a muscle crushed
#: to nothing is blown up over several projections rather than to infinity in one.
VOLUME_FLOOR = 0.01


@vector_kernel
def volume_and_gradient(p: Floats, triangles: Ints, gradient: Floats) -> float:
    """Return the volume inside a closed surface, and write its gradient.

    V = sum p1 . (p2 x p3) / 6 over the triangles. Of dV/dp1 = sum p2 x p3 / 6 the triangles around a point
    leave sum (p2 - p1) x (p3 - p1) / 6, as the surface is closed: the same vector for all three corners,
    which does not depend on the origin. V is homogeneous of degree 3, so that V = sum p . dV/dp / 3.

    Parameters
    ----------
    p : (n, 3) array
        Positions [mm].
    triangles : (m, 3) int array
        Point ids of a closed surface.
    gradient : (n, 3) array
        Overwritten with dV/dp [mm^2].

    Returns
    -------
    float
        Volume [mm^3].
    """
    gradient[:] = 0.0
    for t in range(len(triangles)):
        i, j, k = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, ay, az = p[i, 0], p[i, 1], p[i, 2]
        bx, by, bz = p[j, 0] - ax, p[j, 1] - ay, p[j, 2] - az
        cx, cy, cz = p[k, 0] - ax, p[k, 1] - ay, p[k, 2] - az
        x, y, z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        gradient[i, 0] += x
        gradient[i, 1] += y
        gradient[i, 2] += z
        gradient[j, 0] += x
        gradient[j, 1] += y
        gradient[j, 2] += z
        gradient[k, 0] += x
        gradient[k, 1] += y
        gradient[k, 2] += z
    total = 0.0
    for i in range(len(p)):  # about a point of the muscle: one far from the origin loses no digits
        for c in range(3):
            gradient[i, c] /= 6.0
            total += (p[i, c] - p[0, c]) * gradient[i, c]
    return total / 3.0


@vector_kernel
def project_volume(
    p: Floats, w: Floats, triangles: Ints, rest: float, floor: float, gradient: Floats
) -> float:
    """Move points along the volume's gradient so that the volume is as at rest, to first order.

    p_i -= w_i (V - V0) g_i / sum_j w_j |g_j|^2 (Müller, Heidelberger, Hennix, Ratcliff 2007, *Position based
    dynamics*, doi:10.1016/j.jvcir.2007.01.005, eq. 6-8).

    Parameters
    ----------
    p : (n, 3) array
        Positions [mm], changed in place.
    w : (n,) array
        Inverse masses: 1 free, 0 fixed.
    triangles : (m, 3) int array
        Point ids of a closed surface.
    rest : float
        Rest volume V0 [mm^3].
    floor : float
        Least value of the denominator sum(w |g|^2) [mm^4]; see :data:`VOLUME_FLOOR`.
    gradient : (n, 3) array
        Working memory, overwritten.

    Returns
    -------
    float
        The volume before the projection [mm^3].
    """
    volume = volume_and_gradient(p, triangles, gradient)
    weighted = 0.0
    for i in range(len(p)):
        x, y, z = gradient[i, 0], gradient[i, 1], gradient[i, 2]
        weighted += w[i] * (x * x + y * y + z * z)
    if weighted > 0.0:
        s = (volume - rest) / max(weighted, floor)
        for i in range(len(p)):
            p[i, 0] -= s * w[i] * gradient[i, 0]
            p[i, 1] -= s * w[i] * gradient[i, 1]
            p[i, 2] -= s * w[i] * gradient[i, 2]
    return volume


def halved(points: Floats, triangles: Ints) -> tuple[Floats, Ints, Ints]:
    """Return a mesh with a point more in the middle of each edge, the same surface.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions [mm]; point ids.

    Returns
    -------
    points : (n + e, 3) array
        The given ones, then the middles of the e edges.
    triangles : (4 m, 3) int array
        Four for each, facing as before.
    edges : (e, 2) int array
        Ends of the edges, in the order of their middles.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.mesh.enclosed_volume import halved
    >>> points, triangles, _ = halved(np.eye(3), np.array([[0, 1, 2]]))
    >>> len(points), len(triangles)
    (6, 4)
    """
    edges, number = numbered_edges(triangles)
    a, b, c = triangles.T
    ab, bc, ca = (len(points) + number.reshape(-1, 3)).T
    parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    finer = np.stack([np.column_stack(part) for part in parts], axis=1).reshape(-1, 3)
    middles = points[edges].mean(axis=1)
    return np.vstack([points, middles]), finer, edges


def rounded_volume(points: Floats, triangles: Ints) -> float:
    """Return the volume of a closed mesh whose edges are halved and bulge as the normals at their ends say.

    The middle of an edge is that of the cubic whose ends are at right angles to the normals (Vlachos et al.
    2001, *Curved PN triangles*, doi:10.1145/364338.364387): it is off the chord's by an eighth of the
    difference of the end tangents. So it is the volume of a smooth surface's finer mesh, as far as the
    coarse one tells.

    Parameters
    ----------
    points, triangles : (n, 3) array, (m, 3) int array
        Positions [mm]; point ids, facing outward.

    Returns
    -------
    float
        [mm^3].
    """
    normals = vertex_normals(points, triangles)
    finer, parts, edges = halved(points, triangles)
    ends = normals[edges]
    chords = points[edges[:, 1]] - points[edges[:, 0]]
    along = (chords[:, None] * ends).sum(axis=2)  # (e, 2): how far the chord leaves each tangent plane
    finer[len(points) :] += (along[:, 1:] * ends[:, 1] - along[:, :1] * ends[:, 0]) / 8.0
    return float(signed_volume(finer, parts))
