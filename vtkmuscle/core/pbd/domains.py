"""Large meshes in parts that can be worked on side by side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

Ints = NDArray[np.int64]

#: Parts of a large mesh. It does not depend on the number of threads, so neither does the result.
DOMAINS = 8

#: A mesh is cut into parts from so many edges on; below, waiting for each other would cost what threads gain.
LARGE = 65_536


def order_of_points(edges: Ints, n_points: int) -> Ints:
    """Return in which order to keep the points of a mesh in memory.

    The points of a large mesh are kept in the order of Cuthill, McKee 1969, doi:10.1145/800195.805928, which
    has neighbours near each other, so that a stretch of it has few neighbours outside: a slab across the
    mesh. Those of a small one stay in their order.

    Parameters
    ----------
    edges : (k, 2) int array
        Point ids.
    n_points : int
        Number of points.

    Returns
    -------
    (n,) int array
        Point ids.
    """
    if len(edges) < LARGE:
        return np.arange(n_points)
    rows, columns = np.concatenate([edges, edges[:, ::-1]]).T.astype(np.int32)
    ones = np.ones(len(rows), dtype=np.int8)
    graph = coo_array((ones, (rows, columns)), shape=(n_points, n_points)).tocsr()
    order: Ints = reverse_cuthill_mckee(graph, symmetric_mode=True).astype(np.int64)
    return order


def domains_of_points(work: Ints, *, large: bool) -> Ints:
    """Return the part of the mesh that each point is in, as they lie in memory.

    Parameters
    ----------
    work : (n,) int array
        Constraints whose first point it is: parts have about as many.
    large : bool
        Whether to cut the mesh into parts.

    Returns
    -------
    (n,) int array
        Ascending from 0.
    """
    if not large or not work.any():
        return np.zeros(len(work), dtype=np.int64)
    done = np.cumsum(work)
    parts: Ints = np.minimum((done - work) * DOMAINS // done[-1], DOMAINS - 1)
    return parts


def groups_of_constraints(corners: Ints, domains: Ints) -> tuple[list[Ints], list[int]]:
    """Sort constraints into groups, and the groups into stages whose groups share no point.

    First come the constraints inside each part, then those between a part of even number and the next, then
    those between one of odd number and the next, last those that reach further (none, as a rule).

    Parameters
    ----------
    corners : (m, k) int array
        Point ids of each constraint; ids of ``len(domains)`` and above stand for no point.
    domains : (n,) int array
        Part of each point, from 0 up.

    Returns
    -------
    groups : list of int arrays
        Constraints, ascending.
    stages : list of int
        Stage of each group, ascending.
    """
    count = int(domains.max(initial=0)) + 1
    if count == 1:
        return [np.arange(len(corners))], [0]
    least = np.append(domains, count)[np.minimum(corners, len(domains))].min(axis=1)
    greatest = np.append(domains, -1)[np.minimum(corners, len(domains))].max(axis=1)
    apart = greatest - least
    groups, stages = [], []
    kinds = [(0, part, 0) for part in range(count)]
    kinds += [(1, part, 1) for part in range(0, count, 2)] + [(1, part, 2) for part in range(1, count, 2)]
    for distance, part, stage in kinds:
        groups.append(np.flatnonzero((apart == distance) & (least == part)))
        stages.append(stage)
    groups.append(np.flatnonzero(apart > 1))
    stages.append(3)
    used = [i for i, group in enumerate(groups) if len(group) or stages[i] == 0]
    return [groups[i] for i in used], [stages[i] for i in used]
