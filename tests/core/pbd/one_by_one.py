"""The constraints of the default order one by one, which the batches are tested against."""

import numpy as np

from vtkmuscle.core.jit import vector_kernel
from vtkmuscle.core.pbd.constraints import dihedral, distance


@vector_kernel
def sweep_distances(p, w, edges, rest, stiffness):
    """Project the distance constraint of edges (k, 2) one by one, each seeing what the last one moved.

    p : (n, 3) positions [mm], changed in place; w : (n,) inverse masses; rest : (k,) lengths [mm];
    stiffness : (k,) per iteration.
    """
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        p[i, 0], p[i, 1], p[i, 2], p[j, 0], p[j, 1], p[j, 2] = distance(
            p[i, 0], p[i, 1], p[i, 2], w[i], p[j, 0], p[j, 1], p[j, 2], w[j], rest[e], stiffness[e]
        )


def sweep_dihedrals(p, w, quads, cosines, sines, stiffness, squares=None):
    """Project the dihedral constraint of quadruples of points (q, 4) one by one.

    p : (n, 3) positions [mm], changed in place; w : (n,) inverse masses; cosines, sines : (q,) of the rest
    angles; stiffness : per iteration; squares : (q,) of the angles' gradients at rest, 0 for no length scale.
    """
    squares = np.zeros(len(quads)) if squares is None else squares
    _sweep_dihedrals(p, w, quads, np.asarray(cosines), np.asarray(sines), stiffness, squares)


@vector_kernel
def _sweep_dihedrals(p, w, quads, cosines, sines, stiffness, squares):
    for q in range(len(quads)):
        i, j, k, m = quads[q, 0], quads[q, 1], quads[q, 2], quads[q, 3]
        (
            p[i, 0], p[i, 1], p[i, 2], p[j, 0], p[j, 1], p[j, 2],
            p[k, 0], p[k, 1], p[k, 2], p[m, 0], p[m, 1], p[m, 2],
        ) = dihedral(
            p[i, 0], p[i, 1], p[i, 2], w[i], p[j, 0], p[j, 1], p[j, 2], w[j],
            p[k, 0], p[k, 1], p[k, 2], w[k], p[m, 0], p[m, 1], p[m, 2], w[m],
            cosines[q], sines[q], stiffness, squares[q],
        )  # fmt: skip
