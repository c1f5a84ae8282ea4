"""A muscle of few points that stands in for the full one: solved first, it says where the full one goes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.ring_rotations import ring_rotations, rings_of
from vtkmuscle.core.mesh.surface import vertex_normals
from vtkmuscle.core.mesh.topology import mesh_topology

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: Points of the coarse muscle, about, and the iterations it is solved with. With 600 points the gluteus
#: maximus of a right hip, drawn over the ischium, let it through between them.
COARSE_POINTS = 1200
COARSE_ITERATIONS = 50

#: Height of the roughness at held points, in mean edge lengths: enough to leave about as many of them, in
#: proportion, as of the others.
ROUGHNESS = 0.1

#: Coarse points that a point of the full muscle follows.
NEIGHBOURS = 4


@dataclass(frozen=True, eq=False)
class Binding:
    """Which coarse points each point follows, and how much.

    Attributes
    ----------
    neighbours : (n, k) int array
        Coarse points.
    weights : (n, k) array
        Rows sum to 1.
    """

    neighbours: Ints
    weights: Floats


def coarse_muscle(
    points: Floats, triangles: Ints, fixed_to: Ints, n_coarse: int = COARSE_POINTS, *, hold: bool = False
) -> tuple[Floats, Ints, Ints]:
    """Return a muscle of fewer points with the same attachments.

    Parameters
    ----------
    points : (n, 3) array
        The full muscle at rest [mm].
    triangles : (m, 3) int array
        Point ids of a closed surface.
    fixed_to : (n,) int array
        Index of the bone each point is fixed to, -1 for free points.
    n_coarse : int
        Points to leave, about.
    hold : bool, optional
        Whether to keep more of the fixed points, see :func:`decimate`.

    Returns
    -------
    points : (c, 3) array
        [mm].
    triangles : (t, 3) int array
        Point ids.
    fixed_to : (c,) int array
        As of the full muscle.

    Raises
    ------
    ValueError
        If the decimated surface is not closed, which one of several or very crumpled parts may come to.
    ModuleNotFoundError
        If fast-simplification is not installed.
    """
    coarse, faces = decimate(points, triangles, n_coarse, fixed_to >= 0 if hold else None)
    if not len(faces) or mesh_topology(len(coarse), faces).n_boundary_edges:
        raise ValueError(
            f"a muscle of {len(points)} points cannot be decimated to {n_coarse} and stay closed"
        )
    return coarse, faces, inherit_fixed_points(coarse, points, fixed_to)


class Prolongation:
    """Takes the motion of a coarse muscle over to the full one.

    Parameters
    ----------
    coarse : (c, 3) array
        The coarse muscle at rest [mm].
    triangles : (t, 3) int array
        Its triangles.
    points : (n, 3) array
        The full muscle at rest [mm].
    """

    def __init__(self, coarse: Floats, triangles: Ints, points: Floats) -> None:
        self._triangles = triangles
        self._rings = rings_of(triangles)
        self.binding = bind(points, coarse)

    def prolong(self, before: Floats, now: Floats, points: Floats) -> Floats:
        """Return points of the full muscle, moved as the coarse muscle has moved.

        Each point keeps its place in the frames of its coarse neighbours, which turn with the rings around
        them: x' = sum_j w_j (R_j (x - c_j) + c_j'). From a step before rather than from rest: what the coarse
        muscle errs by is much the same before and after, and drops out.

        Parameters
        ----------
        before, now : (c, 3) arrays
            The coarse muscle [mm].
        points : (n, 3) array
            The full muscle before [mm].

        Returns
        -------
        (n, 3) array
            The full muscle now [mm]. Fixed points have to be put in place after it.
        """
        rotations = ring_rotations(before, now, self._triangles, self._rings)
        result = np.empty_like(points)
        _carry(rotations, before, now, self.binding.neighbours, self.binding.weights, points, result)
        return result


@kernel
def _carry(
    rotations: Floats, before: Floats, now: Floats, near: Ints, weights: Floats, points: Floats, out: Floats
) -> None:
    """Do what :meth:`Prolongation.prolong` says."""
    for i in range(len(points)):
        for a in range(3):
            out[i, a] = 0.0
        for j in range(near.shape[1]):
            c = near[i, j]
            x, y, z = points[i, 0] - before[c, 0], points[i, 1] - before[c, 1], points[i, 2] - before[c, 2]
            for a in range(3):
                moved = rotations[c, a, 0] * x + rotations[c, a, 1] * y + rotations[c, a, 2] * z + now[c, a]
                out[i, a] += weights[i, j] * moved


def decimate(
    points: Floats, triangles: Ints, n_coarse: int, held: Bools | None = None
) -> tuple[Floats, Ints]:
    """Return a surface of about so many points, by quadric edge collapse (Garland, Heckbert 1997).

    A flat attachment area would be left with a point or two, about which the muscle could turn as about a
    ball joint. So the edges to collapse are chosen on a surface that is rough where points are held, if any
    are given.

    Parameters
    ----------
    points : (n, 3) array
        Positions [mm].
    triangles : (m, 3) int array
        Point ids.
    n_coarse : int
        Points to leave, about; a closed surface has twice as many triangles.
    held : (n,) bool array, optional
        Points whose surroundings are to keep more of theirs; none by default.

    Returns
    -------
    points : (c, 3) array
        Positions [mm].
    triangles : (t, 3) int array
        Point ids.
    """
    if len(points) <= n_coarse:
        return points.copy(), triangles.copy()
    import fast_simplification  # noqa: PLC0415 -- only where a coarse muscle is asked for

    whole = np.ascontiguousarray(points)
    faces_in = np.ascontiguousarray(triangles, dtype=np.int32)
    if held is None:
        coarse, faces = fast_simplification.simplify(whole, faces_in, target_count=2 * n_coarse)
    else:
        mean_edge = np.linalg.norm(points[triangles[:, 1]] - points[triangles[:, 0]], axis=1).mean()
        height = ROUGHNESS * mean_edge * np.random.default_rng(0).choice([-1.0, 1.0], len(points))
        rough = np.ascontiguousarray(points + (height * held)[:, None] * vertex_normals(points, triangles))
        _, _, collapses = fast_simplification.simplify(
            rough, faces_in, target_count=2 * n_coarse, return_collapses=True
        )
        coarse, faces, _ = fast_simplification.replay_simplification(whole, faces_in, collapses)
    faces = faces.astype(np.int64)
    used, ids = np.unique(faces, return_inverse=True)
    return coarse[used].astype(np.float64), ids.reshape(-1, 3)


def inherit_fixed_points(coarse: Floats, points: Floats, fixed_to: Ints) -> Ints:
    """Return the bone each coarse point is fixed to: that of the nearest point of the full muscle.

    Every bone keeps at least one coarse point, the nearest to the middle of its fixed points.

    Parameters
    ----------
    coarse : (c, 3) array
        Coarse points at rest [mm].
    points : (n, 3) array
        Points of the full muscle at rest [mm].
    fixed_to : (n,) int array
        Index of the bone each of them is fixed to, -1 for free points.

    Returns
    -------
    (c,) int array
        Likewise of the coarse points.
    """
    _, nearest = cKDTree(points).query(coarse)
    inherited: Ints = fixed_to[nearest].copy()
    for bone in np.unique(fixed_to[fixed_to >= 0]):
        if not (inherited == bone).any():
            centre = points[fixed_to == bone].mean(axis=0)
            order = np.argsort(np.linalg.norm(coarse - centre, axis=1), kind="stable")
            inherited[order[inherited[order] < 0][:1]] = bone
    return inherited


def bind(points: Floats, coarse: Floats) -> Binding:
    """Bind points to the coarse points nearest to them.

    w_j = (1 - d_j / d_(k+1))^2, normalised, with d_(k+1) the distance to the first that is left out: weights
    go to zero before a neighbour is exchanged for another. Sumner, Schmid, Pauly 2007, *Embedded deformation
    for shape manipulation*, doi:10.1145/1276377.1276478, eq. 3 and 4.

    Parameters
    ----------
    points : (n, 3) array
        Of the full muscle at rest [mm].
    coarse : (c, 3) array
        Of the coarse muscle at rest [mm].

    Returns
    -------
    Binding
        With :data:`NEIGHBOURS` neighbours, fewer where there are not so many.
    """
    count = min(NEIGHBOURS, len(coarse) - 1)
    distances, neighbours = cKDTree(coarse).query(points, k=count + 1)
    reach = np.maximum(distances[:, -1:], np.finfo(float).tiny)
    weights = (1.0 - distances[:, :-1] / reach) ** 2
    total = weights.sum(axis=1, keepdims=True)
    # All as far as the one left out: all count the same.
    weights = np.divide(weights, total, out=np.full_like(weights, 1.0 / count), where=total > 0)
    return Binding(neighbours[:, :-1].astype(np.int64), weights)
