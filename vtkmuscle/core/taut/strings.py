"""The kernel that pulls strings taut: Newton's method on chains of springs that bones push aside."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.jit import array_kernel, kernel
from vtkmuscle.core.mesh.solids import FAR
from vtkmuscle.core.taut.bedding import Bedding, bed
from vtkmuscle.core.taut.bone_fields import field_at, slope_at
from vtkmuscle.core.taut.places import apply, nearest_segment, turn_back, value_along
from vtkmuscle.core.taut.ring_contact import Rings, hold_in_ring, let_go
from vtkmuscle.core.taut.springs import PUSH, add_spring, solve
from vtkmuscle.core.taut.string_arrays import Fields, Memory, Tissue, Work
from vtkmuscle.core.types import Bools, Floats, Ints

#: Stiffness of the guide that keeps a point on its track over a bone: that of the springs of a string of
#: ``GUIDED_SEGMENTS``, :mod:`~vtkmuscle.core.taut.paths`. With 100, strings of a real muscle over an edge
#: stay on their tracks in zigzags, and leave them in jumps.
HOLD = 1.0

#: An iteration that turns back on the one before lowers the greatest pace of a string by a factor, and halves
#: its pace, which rises again with those that go on: what goes to and fro between two sets of contacts comes
#: to rest between them, and a string that slides off a bone does not wait.
CALMER, SLOWER, FASTER = 0.7, 0.5, 1.5

#: Part of its gap over which a point may go before a bone is asked again: tissue gets thicker on the way.
SURE = 0.5

#: Greatest part of the springs' stiffness that the curvature of a bone takes away.
LARGEST_BEND = 0.5


@array_kernel
def pull_taut(
    x: Floats,
    to_rest: Floats,
    fields: Fields,
    tissue: Tissue,
    bedding: Bedding,
    rings: Rings,
    memory: Memory,
    stride: float,
    tolerance: float,
    iterations: int,
    unfinished: Bools,
    missing: Ints,
    done: Ints,
) -> int:
    """Pull strings taut, each until its points rest or something that it takes is missing.

    A string of n points between fixed ends takes the least of E = sum |x_{i+1} - x_i|^2 / 2. The tissue
    around the muscle holds the bow that it has at rest (:mod:`~vtkmuscle.core.taut.bedding`). A bone keeps a
    point x away by g(x) = distance(x) - c(x) >= 0, with c the thickness of the tissue at the place of the
    fibre's track (its course over that bone at rest) that is nearest to x. So bones push at right angles to
    the string, all of it has the same tension, and its points spread evenly over its shortest path. A guide
    keeps x on the track, a . (x - nearest place) = 0, with a the direction aside of it. Where a string
    would cross the plane of a via ring outside of the ring, its point nearest to the plane is held on the
    ring's edge: it bends there.

    Bones, guides and rings are springs on tangent planes; which of them push is decided anew in each
    iteration (primal-dual active set; Hintermüller, Ito, Kunisch 2002, *The primal-dual active set strategy
    as a semismooth Newton method*, doi:10.1137/S1052623401383558). Each iteration solves a block-tridiagonal
    system by elimination. A point goes at most ``stride`` farther than its distance from what pushes, so that
    no string jumps through a bone.

    Parameters
    ----------
    x : (f, n, 3) array
        Positions [mm], changed in place but for the ends.
    to_rest : (b, 4, 4) array
        From the scene now to the scene at rest, as each bone moved.
    fields, tissue, bedding, rings, memory
        See the classes; ``memory`` is brought up to date.
    stride : float
        [mm].
    tolerance : float
        A string is done when an iteration would move none of its points by more [mm].
    iterations : int
        At most.
    unfinished : (f,) bool array
        Strings to pull; set to False for those that are done.
    missing : (m,) int array
        Filled with places of blocks that have to be computed first.
    done : (f,) int array
        Iterations done; ``iterations`` + 1 where a string did not come to rest.

    Returns
    -------
    int
        How many blocks are missing, at most m. Strings that came to one stay unfinished: fill these and call
        again.
    """
    b, n = len(to_rest), x.shape[1]
    work = Work(
        np.empty((b, n)),
        np.empty((b, n)),
        np.zeros((b, n, 3)),
        np.empty((b, n)),
        np.zeros((b, n), dtype=np.bool_),
        np.empty((n, 6)),
        np.empty((n, 3)),
        np.zeros((n, 3)),
        np.empty((n, 3)),
        np.empty((len(rings.frames), 5)),
        np.empty((4, 3)),
    )
    found = 0
    for f in range(len(x)):
        if unfinished[f]:
            known = found
            done[f], found = _pull(
                f, x[f], to_rest, fields, tissue, bedding, rings, memory, stride, tolerance, iterations,
                missing, found, work,
            )  # fmt: skip
            unfinished[f] = found > known
    return min(found, len(missing))


@kernel
def _pull(
    f: int,
    p: Floats,
    to_rest: Floats,
    fields: Fields,
    tissue: Tissue,
    bedding: Bedding,
    rings: Rings,
    memory: Memory,
    stride: float,
    tolerance: float,
    iterations: int,
    missing: Ints,
    found: int,
    work: Work,
) -> tuple[int, int]:
    """Pull string f, whose points are p; return its ``done`` and how many blocks are known to be missing."""
    work.gap[:], work.away[:], work.pressure[:], work.held[:], work.last[:] = np.inf, 0.0, 0.0, 0.0, 0.0
    pace, most = 1.0, 1.0
    for count in range(iterations):
        known = found
        found = _set_up(f, p, to_rest, fields, tissue, bedding, rings, memory, missing, found, work)
        if found > known:
            return count + 1, found
        solve(p, work.matrices, work.right, work.solved)
        for ring in range(len(rings.frames)):
            let_go(work.held[ring], work.solved)
        farthest, onward = _go_on(f, p, tissue, memory, stride, pace, work)
        if pace * farthest <= tolerance:
            return count + 1, found
        if onward < 0.0:
            most *= CALMER
        pace = min(most, SLOWER * pace if onward < 0.0 else FASTER * pace)
    return iterations + 1, found


@kernel
def _set_up(
    f: int,
    p: Floats,
    to_rest: Floats,
    fields: Fields,
    tissue: Tissue,
    bedding: Bedding,
    rings: Rings,
    memory: Memory,
    missing: Ints,
    found: int,
    work: Work,
) -> int:
    """Write the equations of an iteration; return how many missing blocks are known."""
    known = found
    for i in range(1, len(p) - 1):
        a, r = work.matrices[i], work.right[i]
        a[0], a[1], a[2], a[3], a[4], a[5] = 2.0, 0.0, 0.0, 2.0, 0.0, 2.0
        r[0], r[1], r[2] = 0.0, 0.0, 0.0
        for k in range(len(to_rest)):
            work.used[k, i] = False
            if tissue.within[k, f] == -np.inf or work.away[k, i] > 0.0:
                continue
            lack = _push(k, f, i, p[i], to_rest, fields, tissue, memory, work)
            if lack >= 0:
                if found < len(missing):
                    missing[found] = lack
                found += 1
            if work.used[k, i]:
                _bend(p, work.normal[k], work.pressure[k], i, a, r, work.vectors[0])
    if found > known:
        return found
    for k in range(len(to_rest)):
        if bedding.bedded[k, f]:
            bed(p, f, k, to_rest[k], bedding, work.matrices, work.right, work.vectors)
    for ring in range(len(rings.frames)):
        hold_in_ring(rings, ring, f, p, work.held[ring], work.matrices, work.right)
    return found


@kernel
def _go_on(
    f: int, p: Floats, tissue: Tissue, memory: Memory, stride: float, pace: float, work: Work
) -> tuple[float, float]:
    """Move points towards where the equations have them, as far as is safe, and note which bones push.

    Returns
    -------
    farthest : float
        How far a point would go at full pace, at most [mm].
    onward : float
        How much the points go on as they went before; negative where they turn back.
    """
    farthest, onward = 0.0, 0.0
    gap, last, normal = work.gap, work.last, work.normal
    for i in range(1, len(p) - 1):
        dx, dy, dz = work.solved[i, 0] - p[i, 0], work.solved[i, 1] - p[i, 1], work.solved[i, 2] - p[i, 2]
        room = np.inf
        for k in range(len(gap)):
            gone, used = gap[k, i], work.used[k, i]
            if used:
                gone += normal[k, i, 0] * dx + normal[k, i, 1] * dy + normal[k, i, 2] * dz
                room = 0.0
            elif tissue.within[k, f] != -np.inf:
                room = min(room, max(gap[k, i], 0.0))
            memory.pushed[k, f, i] = used and gone < 0.0
            work.pressure[k, i] = max(-PUSH * gone, 0.0) if used else 0.0
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        part = min(1.0, (stride + room) / length) if length > 0.0 else 1.0
        farthest = max(farthest, part * length)
        onward += part * (dx * last[i, 0] + dy * last[i, 1] + dz * last[i, 2])
        last[i, 0], last[i, 1], last[i, 2] = part * dx, part * dy, part * dz
        part *= pace
        p[i, 0], p[i, 1], p[i, 2] = p[i, 0] + part * dx, p[i, 1] + part * dy, p[i, 2] + part * dz
        for k in range(len(gap)):
            work.away[k, i] -= part * length
            gap[k, i] -= part * length
    return farthest, onward


@kernel
def _push(
    k: int,
    f: int,
    i: int,
    at: Floats,
    to_rest: Floats,
    fields: Fields,
    tissue: Tissue,
    memory: Memory,
    work: Work,
) -> int:
    """Add what bone k does to point i of string f, which is ``at``; return a block that is missing, or -1."""
    u, v, slope, side = work.vectors[0], work.vectors[1], work.vectors[2], work.vectors[3]
    gap, away, matrix, right = work.gap, work.away, work.matrices[i], work.right[i]
    apply(to_rest[k], at, u)
    apply(fields.to_axes[k], u, v)
    layout = fields.layout[k]
    distance, lack = field_at(layout, fields.table, fields.values, v[0], v[1], v[2])
    gap[k, i] = away[k, i] = distance - tissue.within[k, f]
    if lack >= 0 or not gap[k, i] < 0.0 or distance == FAR:
        return lack
    track = tissue.track[f]
    j = memory.place[k, f, i] = nearest_segment(track, u, memory.place[k, f, i])
    q0, q1 = track[j], track[j + 1]
    lx, ly, lz = q1[0] - q0[0], q1[1] - q0[1], q1[2] - q0[2]
    length2 = lx * lx + ly * ly + lz * lz
    part = ((u[0] - q0[0]) * lx + (u[1] - q0[1]) * ly + (u[2] - q0[2]) * lz) / length2
    beyond = not 0.0 < part < 1.0
    part = min(max(part, 0.0), 1.0)
    keep, rise = value_along(tissue.thickness[k, f], j + part)
    rise = 0.0 if beyond else rise / length2
    gap[k, i] = distance - keep
    if memory.pushed[k, f, i] or gap[k, i] < 0.0:
        lack = slope_at(layout, fields.table, fields.values, v[0], v[1], v[2], slope)
        if lack >= 0:
            return lack
        work.used[k, i] = True
        m = fields.to_axes[k]
        for q in range(3):
            side[q] = m[0, q] * slope[0] + m[1, q] * slope[1] + m[2, q] * slope[2] - rise * (q1[q] - q0[q])
        n = work.normal[k, i]
        turn_back(to_rest[k], side, n)
        add_spring(n, PUSH, n[0] * at[0] + n[1] * at[1] + n[2] * at[2] - gap[k, i], matrix, right)
    else:
        away[k, i] = SURE * (gap[k, i] - (tissue.hold if tissue.guided[k, f] else 0.0))
    near = max(gap[k, i], 0.0) / tissue.hold
    if tissue.guided[k, f] and near < 1.0:
        hold = HOLD * (1.0 - near * near) ** 2 * value_along(tissue.guide[k, f], j + part)[0]
        off = 0.0
        for q in range(3):
            side[q] = (1.0 - part) * tissue.aside[k, f, j, q] + part * tissue.aside[k, f, j + 1, q]
            off += side[q] * (u[q] - q0[q] - part * (q1[q] - q0[q]))
        turn_back(to_rest[k], side, slope)
        target = slope[0] * at[0] + slope[1] * at[1] + slope[2] * at[2] - off
        add_spring(slope, hold, target, matrix, right)
    return -1


@kernel
def _bend(
    p: Floats, normals: Floats, pressure: Floats, i: int, matrix: Floats, right: Floats, along: Floats
) -> None:
    """Take away what the curvature of a bone takes from the springs: a point that slides goes along it.

    By the normals at the points before and after; where they press, too. With it iterations come to rest soon
    after a few; without it each comes nearer by the same factor. ``along`` is working memory.
    """
    if not (pressure[i - 1] > 0.0 and pressure[i] > 0.0 and pressure[i + 1] > 0.0):
        return
    for q in range(3):
        along[q] = p[i + 1, q] - p[i - 1, q]
    length2 = along[0] * along[0] + along[1] * along[1] + along[2] * along[2]
    bend = 0.0
    for q in range(3):
        bend += (normals[i + 1, q] - normals[i - 1, q]) * along[q]
    bend = min(max(pressure[i] * bend / length2, -LARGEST_BEND), LARGEST_BEND) / length2
    at = along[0] * p[i, 0] + along[1] * p[i, 1] + along[2] * p[i, 2]
    add_spring(along, -bend, at, matrix, right)
