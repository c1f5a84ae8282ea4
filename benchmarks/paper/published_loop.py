"""The loop of the code published with Kohout and Červenka 2021, as far as it is not their Algorithm 2.

Read from github.com/cervenkam/muscle-deformation-PBD at 66cce66 (``src/pbd.cxx``, ``src/graph.cxx``) and
written anew: in each *iteration*, points are moved on by their velocity and get a new one; each edge is
projected from both of its ends with the stiffness ``(1 - |u.v|)^0.5``; the dihedral angle is that of an
arccosine, and its correction is left out for nearly flat pairs, and where the factor of the gradients is
not between 0.1 and 10, which are all corrections of one sign and all small ones. Collisions are left out
here.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.rest_shape import project_volume, volume_and_gradient
from vtkmuscle.core.mesh.surface import mesh_topology

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

DAMPING, BENDING, POWER = 0.99, 0.9, 0.5
#: Factors of a dihedral correction that are applied [mm^2], and how far from flat a pair has to be.
LEAST, MOST, FLAT = 0.1, 10.0, 1e-10
FLOOR = 1e-4


@array_kernel
def _gradients(p, quad, q):
    """Write q of Müller et al. 2007, Appendix A, minus the gradients of cos (4, 3); return cos, or 2."""
    a = p[quad[0]]
    p2, p3, p4 = p[quad[1]] - a, p[quad[2]] - a, p[quad[3]] - a
    n1, n2 = np.cross(p2, p3), np.cross(p2, p4)
    l1, l2 = math.sqrt(np.sum(n1 * n1)), math.sqrt(np.sum(n2 * n2))
    if l1 == 0.0 or l2 == 0.0:
        return 2.0
    n1 /= l1
    n2 /= l2
    d = np.sum(n1 * n2)
    q[2] = (np.cross(p2, n2) + d * np.cross(n1, p2)) / l1
    q[3] = (np.cross(p2, n1) + d * np.cross(n2, p2)) / l2
    q[1] = -(np.cross(p3, n2) + d * np.cross(n1, p3)) / l1 - (np.cross(p4, n1) + d * np.cross(n2, p4)) / l2
    q[0] = -q[1] - q[2] - q[3]
    return d


@array_kernel
def _project_angles(p, w, quads, angles):
    """Project dihedral angles as the code does; return how many pairs were corrected."""
    q, corrected = np.empty((4, 3)), 0
    for k in range(len(quads)):
        d = _gradients(p, quads[k], q)
        if not -1.0 + FLAT <= d <= 1.0 - FLAT:
            continue
        mass = w[quads[k, 0]] + w[quads[k, 1]] + w[quads[k, 2]] + w[quads[k, 3]]
        if mass == 0.0:
            continue
        off = math.sqrt(1.0 - d * d) * (math.acos(d) - angles[k])
        factor = -4.0 * off * BENDING / (max(FLOOR, np.sum(q * q)) * mass)
        if LEAST <= factor <= MOST:
            corrected += 1
            for i in range(4):
                p[quads[k, i]] += factor * w[quads[k, i]] * q[i]
    return corrected


@kernel
def _project_lengths(p, w, edges, lengths, powers):
    """Project the lengths of edges one by one, by the masses of their ends."""
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        x, y, z = p[i, 0] - p[j, 0], p[i, 1] - p[j, 1], p[i, 2] - p[j, 2]
        length = math.sqrt(x * x + y * y + z * z)
        weight = length * (w[i] + w[j])
        s = powers[e] * (length - lengths[e]) / weight if weight > 0.0 else 0.0
        si, sj = w[i] * s, w[j] * s
        p[i, 0], p[i, 1], p[i, 2] = p[i, 0] - si * x, p[i, 1] - si * y, p[i, 2] - si * z
        p[j, 0], p[j, 1], p[j, 2] = p[j, 0] + sj * x, p[j, 1] + sj * y, p[j, 2] + sj * z


@array_kernel
def _angles(p, quads):
    """Return the angles at rest."""
    q, found = np.empty((4, 3)), np.empty(len(quads))
    for k in range(len(quads)):
        found[k] = math.acos(min(1.0, max(-1.0, _gradients(p, quads[k], q))))
    return found


def run(
    rest: Floats, triangles: Ints, fixed_to: Ints, stiffness: Floats, poses: Floats, iterations: int
) -> tuple[Floats, float, Floats]:
    """Return mean displacements per frame and iteration, the share of pairs corrected, and the end.

    Parameters
    ----------
    rest : (n, 3) array
        Points at rest [mm].
    triangles : (m, 3) int array
        Outward.
    fixed_to : (n,) int array
        Bone that a point is fixed to, -1 where it is free.
    stiffness : (e,) array
        ``1 - |u.v|`` of the edges of ``mesh_topology(n, triangles)``.
    poses : (f, bones, 4, 4) array
        Where the bones are in each frame.
    iterations : int
        Per frame.
    """
    topology = mesh_topology(len(rest), triangles)
    quads = np.ascontiguousarray(topology.quads)
    both = np.vstack([topology.edges, topology.edges[:, ::-1]])
    order = np.argsort(both[:, 0], kind="stable")
    edges, powers = np.ascontiguousarray(both[order]), np.tile(stiffness**POWER, 2)[order]
    lengths = np.linalg.norm(rest[edges[:, 1]] - rest[edges[:, 0]], axis=1)
    free = fixed_to < 0
    w, ones, gradient = free.astype(np.float64), np.ones(len(rest)), np.empty_like(rest)
    volume, angles = volume_and_gradient(rest, triangles, gradient), _angles(rest, quads)
    held = w[edges].any(axis=1)
    edges, powers, lengths = edges[held], powers[held], lengths[held]
    x, v, moves, corrected = rest.copy(), np.zeros_like(rest), [], 0
    for pose in poses:
        for bone, transform in enumerate(pose):
            x[fixed_to == bone] = rest[fixed_to == bone] @ transform[:3, :3].T + transform[:3, 3]
        for _ in range(iterations):
            v *= DAMPING
            p = x + v
            _project_lengths(p, w, edges, lengths, powers)
            # Fixed points take their part of the volume's correction there, and are put back.
            project_volume(p, ones, ones, triangles, volume, 1.0, 0.0, gradient)
            corrected += _project_angles(p, w, quads, angles)
            p[~free] = x[~free]
            v = p - x
            moves.append(float(np.linalg.norm(v, axis=1).mean()))
            x = p
    by_frame = np.reshape(moves, (len(poses), iterations))
    return by_frame, corrected / (len(quads) * len(moves)), x
