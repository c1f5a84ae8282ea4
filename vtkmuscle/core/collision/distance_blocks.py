"""Kernels that fill the blocks of a distance grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.triangle_distance import Sides, nearest_on_triangle, pseudonormal_at
from vtkmuscle.core.types import Bools, Floats, Ints, Singles

Members = NDArray[np.int32]

#: Cells along the side of a block.
SIDE = 8

#: Change of a depth, in cells, that is as good as none.
_SETTLED = 1e-3


def triangles_of_blocks(
    corners: Floats, origin: Floats, cell: float, band: float, shape: tuple[int, ...]
) -> tuple[Ints, Members]:
    """Return which triangles may be within the band of each block's nodes.

    Parameters
    ----------
    corners : (m, 3, 3) array
        Of the triangles [mm].
    origin : (3,) array
        Node (0, 0, 0) [mm].
    cell, band : float
        [mm].
    shape : tuple of int
        Number of blocks along each axis.

    Returns
    -------
    offsets : (n + 1,) int array
        Block i, numbered in C order, has ``members[offsets[i]:offsets[i + 1]]``.
    members : (k,) int32 array
        Triangles, ascending within each block.
    """
    counts = np.array(shape, dtype=np.int64)
    offsets = np.zeros(int(counts.prod()) + 1, dtype=np.int64)
    members = np.empty(0, dtype=np.int32)
    _list_triangles(corners, origin, cell, band, counts, offsets, members)
    offsets = np.cumsum(offsets)
    members = np.empty(offsets[-1], dtype=np.int32)
    _list_triangles(corners, origin, cell, band, counts, offsets[:-1].copy(), members)
    return offsets, members


@array_kernel
def _list_triangles(
    corners: Floats, origin: Floats, cell: float, band: float, counts: Ints, next_free: Ints, members: Members
) -> None:
    """Write each triangle to the lists of the blocks in reach, or count them where members is empty.

    A block is in reach where the triangle's box, grown by the band, holds a node of it and the triangle's
    plane is near enough to the block's middle.
    next_free : (n,) where the list of block i goes on, or (n + 1,), the count of block i at i + 1.
    """
    counting = len(members) == 0
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    far = band + 0.5 * (SIDE - 1) * cell * np.sqrt(3.0) * (1.0 + 1e-9)
    for triangle in range(len(corners)):
        a, b, c = corners[triangle, 0], corners[triangle, 1], corners[triangle, 2]
        for k in range(3):
            low = (min(a[k], b[k], c[k]) - band - origin[k]) / cell
            high = (max(a[k], b[k], c[k]) + band - origin[k]) / cell
            first[k] = max(0, int(np.ceil(low)) // SIDE)
            last[k] = min(counts[k] - 1, int(np.floor(high)) // SIDE)
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        limit = far * np.sqrt(nx * nx + ny * ny + nz * nz)
        middle = 0.5 * (SIDE - 1)
        for i in range(first[0], last[0] + 1):
            x = origin[0] + cell * (SIDE * i + middle) - a[0]
            for j in range(first[1], last[1] + 1):
                y = origin[1] + cell * (SIDE * j + middle) - a[1]
                for k in range(first[2], last[2] + 1):
                    z = origin[2] + cell * (SIDE * k + middle) - a[2]
                    if abs(nx * x + ny * y + nz * z) > limit:
                        continue
                    block = (i * counts[1] + j) * counts[2] + k
                    if counting:
                        next_free[block + 1] += 1
                    else:
                        members[next_free[block]] = triangle
                        next_free[block] += 1


@array_kernel
def fill_band(
    blocks: Ints,
    positions: Ints,
    offsets: Ints,
    members: Members,
    corners: Floats,
    sides: Sides,
    origin: Floats,
    cell: float,
    band: float,
    values: Singles,
    in_band: Bools,
) -> None:
    """Write the signed distance, at most the band, of each node of some blocks.

    The side of a node within the band follows from the normal at the nearest point. Between neighbouring
    nodes beyond the band there is no surface, so they take the side of a neighbour.
    blocks : (n,), with the triangles offsets, members;  positions : (n, 3) in blocks;
    corners : (m, 3, 3) [mm], of the triangles of sides;  values : (n, 8, 8, 8), written;
    in_band : (n,), written, False where all nodes are beyond the band (values are without sign then).
    """
    nearest = np.empty((SIDE, SIDE, SIDE), np.int64)
    distance = np.empty((SIDE, SIDE, SIDE))
    base = np.empty(3)
    for n in range(len(blocks)):
        for k in range(3):
            base[k] = origin[k] + cell * SIDE * positions[n, k]
        nearest[:] = -1
        distance[:] = band
        for place in range(offsets[blocks[n]], offsets[blocks[n] + 1]):
            _measure(members[place], corners, base, cell, band, distance, nearest)
        left = 0
        for i in range(SIDE):
            for j in range(SIDE):
                for k in range(SIDE):
                    triangle = nearest[i, j, k]
                    if triangle < 0:
                        values[n, i, j, k] = np.nan
                        left += 1
                        continue
                    a, b, c = corners[triangle, 0], corners[triangle, 1], corners[triangle, 2]
                    x, y, z = base[0] + cell * i, base[1] + cell * j, base[2] + cell * k
                    px, py, pz, where = nearest_on_triangle(x, y, z, a, b, c)
                    nx, ny, nz = pseudonormal_at(sides, triangle, where)
                    along = (x - px) * nx + (y - py) * ny + (z - pz) * nz
                    values[n, i, j, k] = -distance[i, j, k] if along < 0.0 else distance[i, j, k]
        in_band[n] = left < SIDE**3
        if in_band[n]:
            _spread_sides(values[n], band, left)
        else:
            values[n] = band


@array_kernel
def _measure(
    triangle: int, corners: Floats, base: Floats, cell: float, band: float, distance: Floats, nearest: Ints
) -> None:
    """Note a triangle for the nodes of a block to which it is nearer than those before.

    base : (3,) node (0, 0, 0) [mm];  distance, nearest : (8, 8, 8), changed in place.
    """
    a, b, c = corners[triangle, 0], corners[triangle, 1], corners[triangle, 2]
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    for k in range(3):
        low = (min(a[k], b[k], c[k]) - band - base[k]) / cell
        high = (max(a[k], b[k], c[k]) + band - base[k]) / cell
        first[k] = max(0, int(np.ceil(low)))
        last[k] = min(SIDE - 1, int(np.floor(high)))
    # A sphere about the triangle, to see at once that a node has a nearer one.
    mx, my, mz = (a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0, (a[2] + b[2] + c[2]) / 3.0
    radius = 0.0
    for corner in range(3):
        q = corners[triangle, corner]
        radius = max(radius, (q[0] - mx) ** 2 + (q[1] - my) ** 2 + (q[2] - mz) ** 2)
    radius = np.sqrt(radius) * (1.0 + 1e-9)
    for i in range(first[0], last[0] + 1):
        x = base[0] + cell * i
        for j in range(first[1], last[1] + 1):
            y = base[1] + cell * j
            for k in range(first[2], last[2] + 1):
                z = base[2] + cell * k
                reach = distance[i, j, k] + radius
                if (x - mx) ** 2 + (y - my) ** 2 + (z - mz) ** 2 > reach * reach:
                    continue
                px, py, pz, _ = nearest_on_triangle(x, y, z, a, b, c)
                d = np.sqrt((x - px) ** 2 + (y - py) ** 2 + (z - pz) ** 2)
                if d < distance[i, j, k]:
                    distance[i, j, k] = d
                    nearest[i, j, k] = triangle


@array_kernel
def _spread_sides(values: Singles, band: float, left: int) -> None:
    """Replace NaN by the band, on the side of a node next to it; values : (8, 8, 8), in place.

    left : number of NaN, not all of them.
    """
    flat = values.reshape(-1)
    outside, inside = np.float32(band), np.float32(-band)
    while left:
        for stride in (1, SIDE, SIDE * SIDE):  # along z, y, x, forth and back
            for line in range(SIDE * SIDE):
                start = line % stride + line // stride * stride * SIDE
                for step in (stride, -stride):
                    node = start if step > 0 else start + (SIDE - 1) * stride
                    before = flat[node]
                    for _ in range(SIDE - 1):
                        node += step
                        here = flat[node]
                        if np.isnan(here) and not np.isnan(before):
                            here = inside if before < 0.0 else outside
                            flat[node] = here
                            left -= 1
                        before = here


@array_kernel
def fill_inside(  # noqa: PLR0912 -- a queue in one piece
    values: Singles, neighbours: Ints, cell: float, band: float
) -> None:
    """Replace the values -band by those of a front that goes inward from the band.

    |grad u| = 1 by the upwind differences of Zhao 2005, *A fast sweeping method for Eikonal equations*,
    doi:10.1090/S0025-5718-04-01678-3; nodes wait in line, again when a neighbour's depth has lessened.
    values : (n, 8, 8, 8), changed in place;  neighbours : (n, 6) blocks before and after along x, y, z.
    """
    depth = -values.reshape(-1)  # a copy
    unknown = depth >= band
    n_unknown = 0
    endless = cell * SIDE * (len(values) + 1.0)
    for node in range(len(depth)):
        if unknown[node]:
            depth[node] = endless
            n_unknown += 1
    line, waits = np.empty(n_unknown + 1, np.int64), np.zeros(len(depth), np.bool_)
    near = np.empty(3)
    head = count = 0
    for node in range(len(depth)):
        if unknown[node]:
            for side in range(6):
                other = _next_node(node, side, neighbours)
                if other >= 0 and not unknown[other] and not waits[node]:
                    waits[node] = True
                    line[count] = node
                    count += 1
    while count:
        node = line[head]
        head = (head + 1) % len(line)
        count -= 1
        waits[node] = False
        for axis in range(3):
            near[axis] = endless
            for side in range(2):
                other = _next_node(node, 2 * axis + side, neighbours)
                if other >= 0:
                    near[axis] = min(near[axis], depth[other])
        arrival = _front(near, cell)
        if arrival >= depth[node] - _SETTLED * cell:
            continue
        depth[node] = arrival
        for side in range(6):
            other = _next_node(node, side, neighbours)
            if other >= 0 and unknown[other] and not waits[other] and depth[other] > arrival:
                waits[other] = True
                line[(head + count) % len(line)] = other
                count += 1
    flat = values.reshape(-1)
    for node in range(len(depth)):
        flat[node] = -depth[node]


@kernel
def _next_node(node: int, side: int, neighbours: Ints) -> int:
    """Return the node before or after a node along an axis, -1 where no block holds it.

    Nodes count through block, x, y, z;  side : 0 before in x, 1 after in x, 2 before in y and so on.
    """
    stride = SIDE * SIDE if side < 2 else (SIDE if side < 4 else 1)
    place = node // stride % SIDE
    if side % 2 == 0:
        if place > 0:
            return node - stride
        block = neighbours[node // SIDE**3, side]
        return block * SIDE**3 + node % SIDE**3 + (SIDE - 1) * stride if block >= 0 else -1
    if place < SIDE - 1:
        return node + stride
    block = neighbours[node // SIDE**3, side]
    return block * SIDE**3 + node % SIDE**3 - (SIDE - 1) * stride if block >= 0 else -1


@kernel
def _front(near: Floats, cell: float) -> float:
    """Return the depth u of a node from the least depths next to it along each axis.

    Solves sum over axes of max(u - near, 0)^2 = cell^2 (Zhao 2005, section 2).
    near : (3,).
    """
    a, c = min(near[0], near[1], near[2]), max(near[0], near[1], near[2])
    b = max(min(near[0], near[1]), min(max(near[0], near[1]), near[2]))
    depth: float = a + cell
    if depth > b:
        depth = 0.5 * (a + b + np.sqrt(2.0 * cell * cell - (a - b) ** 2))
        if depth > c:
            total, squares = a + b + c, a * a + b * b + c * c
            depth = (total + np.sqrt(max(0.0, total * total - 3.0 * (squares - cell * cell)))) / 3.0
    return depth


@kernel
def with_far_faces(
    values: Singles, table: NDArray[np.int32], positions: Ints, outside: float, whole: Singles
) -> None:
    """Write each block with the first nodes of the blocks behind it, so that its cells need no other block.

    values : (n, 8, 8, 8);  whole : (n, 9, 9, 9), written;  positions : (n, 3) of the blocks in the table.
    Blocks that are not stored are outside; at the end of the grid the last nodes are repeated.
    """
    for n in range(len(values)):
        for i in range(SIDE + 1):
            bi, ni = positions[n, 0] + i // SIDE, i % SIDE
            if bi == table.shape[0]:
                bi, ni = bi - 1, SIDE - 1
            for j in range(SIDE + 1):
                bj, nj = positions[n, 1] + j // SIDE, j % SIDE
                if bj == table.shape[1]:
                    bj, nj = bj - 1, SIDE - 1
                for k in range(SIDE + 1):
                    bk, nk = positions[n, 2] + k // SIDE, k % SIDE
                    if bk == table.shape[2]:
                        bk, nk = bk - 1, SIDE - 1
                    block = table[bi, bj, bk]
                    whole[n, i, j, k] = values[block, ni, nj, nk] if block >= 0 else outside
