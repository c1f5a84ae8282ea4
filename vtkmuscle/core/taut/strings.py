"""The kernel that pulls strings taut: Newton's method on chains of springs that bones push aside."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.taut.bedding import Bedding
from vtkmuscle.core.taut.bone_fields import FAR, field_at, slope_at
from vtkmuscle.core.taut.via_rings import is_inside, nearest_on_polygon
from vtkmuscle.core.types import Bools, Floats, Ints, Table

#: Stiffness of a bone or ring against a string's point, in stiffnesses of the string's springs. A point on a
#: bone of radius R with points h apart sinks in by h^2 / (R PUSH): 1e-4 mm where h is 4 mm and R 10 mm.
PUSH = 1e4

#: Stiffness of the guide that keeps a point on its track over a bone, likewise.
HOLD = 100.0

#: An iteration that turns back on the one before lowers the greatest pace of a string by a factor, and halves
#: its pace, which rises again with those that go on: what goes to and fro between two sets of contacts comes
#: to rest between them, and a string that slides off a bone does not wait.
CALMER, SLOWER, FASTER = 0.7, 0.5, 1.5

#: Part of its gap over which a point may go before a bone is asked again: tissue gets thicker on the way.
SURE = 0.5

#: Greatest part of the springs' stiffness that the curvature of a bone takes away.
LARGEST_BEND = 0.5


class Fields(NamedTuple):
    """Distances from the bones, as of :class:`~vtkmuscle.core.taut.bone_fields.BoneFields`.

    Attributes
    ----------
    to_axes : (b, 4, 4) array
        From the scene at rest to the axes of each bone's field.
    layout : (b, 8) array
    table : (t,) int32 array
    values : (v, 9, 9, 9) array
    """

    to_axes: Floats
    layout: Floats
    table: Table
    values: Floats


class Tissue(NamedTuple):
    """What lies between fibres and bones at rest.

    Attributes
    ----------
    track : (f, n, 3) array
        The fibres at rest [mm].
    thickness : (b, f, n) array
        Of the tissue between each point of a track and each bone [mm].
    within : (b, f) array
        How near a string comes to a bone before anything is asked of it [mm]; -inf where nothing ever is.
    guide : (b, f, n) array
        How firmly a string is kept on its track at each point of it: 0 for not at all, 1 for :data:`HOLD`.
    aside : (b, f, n, 3) array
        Unit direction aside of the track over the bone.
    guided : (b, f) bool array
        Where any ``guide`` is more than 0.
    hold : float
        How far off the tissue below a string is from the bone when the guide lets go [mm].
    """

    track: Floats
    thickness: Floats
    within: Floats
    guide: Floats
    aside: Floats
    guided: Bools
    hold: float


class Rings(NamedTuple):
    """Via rings now, and how far strings are outside of them at rest.

    Attributes
    ----------
    frames : (r, 4, 3) array
        Centre [mm], unit normal, and the two axes of the plane of each ring.
    corners : (c, 2) array
        Of all rings' polygons, along the axes about the centre [mm].
    offsets : (r + 1,) int array
        First corner of each ring, and c.
    outside : (r, f) array
        How far outside a string may be, as it is at rest [mm].
    """

    frames: Floats
    corners: Floats
    offsets: Ints
    outside: Floats


class Memory(NamedTuple):
    """What is known of strings' points from the pose before; it saves iterations.

    Attributes
    ----------
    place : (b, f, n) int array
        Segment of the track over each bone that a point is nearest to.
    pushed : (b, f, n) bool array
        Which bones push which points.
    """

    place: Ints
    pushed: Bools


@kernel
def pull_taut(  # noqa: PLR0912, PLR0915 - one loop, whose parts share all that they know
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

    A string of n points between fixed ends takes the least of E = sum |x_{i+1} - x_i|^2 / 2. A bone keeps a
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
    n_bones, n = len(to_rest), x.shape[1]
    gap, away = np.empty((n_bones, n)), np.empty((n_bones, n))
    normal, pressure = np.zeros((n_bones, n, 3)), np.zeros((n_bones, n))
    used = np.zeros((n_bones, n), dtype=np.bool_)
    matrices, right, y = np.empty((n, 6)), np.empty((n, 3)), np.zeros((n, 3))
    held = np.zeros((len(rings.frames), 5))
    work, last = np.empty((4, 3)), np.empty((n, 3))
    n_missing = 0
    for f in range(len(x)):
        if not unfinished[f]:
            continue
        p = x[f]
        gap[:], away[:], pressure[:], held[:] = np.inf, 0.0, 0.0, 0.0
        pace, most, lacking, rests = 1.0, 1.0, False, False
        last[:] = 0.0
        for count in range(iterations):
            done[f] = count + 1
            for i in range(1, n - 1):
                a, r = matrices[i], right[i]
                a[0], a[1], a[2], a[3], a[4], a[5] = 2.0, 0.0, 0.0, 2.0, 0.0, 2.0
                r[:] = 0.0
                for k in range(n_bones):
                    used[k, i] = False
                    if tissue.within[k, f] == -np.inf or away[k, i] > 0.0:
                        continue
                    lack = _push(
                        k, f, i, p[i], to_rest, fields, tissue, memory, gap, away, normal, used, a, r, work
                    )
                    if lack >= 0:
                        lacking = True
                        if n_missing < len(missing):
                            missing[n_missing] = lack
                            n_missing += 1
                    if used[k, i]:
                        _bend(p, normal[k], pressure[k], i, a, r, work[0])
            if lacking:
                break
            for k in range(n_bones):
                if bedding.bedded[k, f]:
                    _bed(
                        p,
                        to_rest[k],
                        bedding.course[f],
                        bedding.force[k, f],
                        bedding.give,
                        matrices,
                        right,
                        work,
                    )
            for ring in range(len(rings.frames)):
                _hold_in_ring(rings, ring, f, p, held[ring], matrices, right)
            _solve(p, matrices, right, y)
            for ring in range(len(rings.frames)):
                _let_go(held[ring], y)
            wanted, onward = 0.0, 0.0
            for i in range(1, n - 1):
                dx, dy, dz = y[i, 0] - p[i, 0], y[i, 1] - p[i, 1], y[i, 2] - p[i, 2]
                room = np.inf
                for k in range(n_bones):
                    gone = gap[k, i]
                    if used[k, i]:
                        gone += normal[k, i, 0] * dx + normal[k, i, 1] * dy + normal[k, i, 2] * dz
                        room = 0.0
                    elif tissue.within[k, f] != -np.inf:
                        room = min(room, max(gap[k, i], 0.0))
                    memory.pushed[k, f, i] = used[k, i] and gone < 0.0
                    pressure[k, i] = max(-PUSH * gone, 0.0) if used[k, i] else 0.0
                length = np.sqrt(dx * dx + dy * dy + dz * dz)
                part = min(1.0, (stride + room) / length) if length > 0.0 else 1.0
                wanted = max(wanted, part * length)
                onward += part * (dx * last[i, 0] + dy * last[i, 1] + dz * last[i, 2])
                last[i, 0], last[i, 1], last[i, 2] = part * dx, part * dy, part * dz
                part *= pace
                p[i, 0], p[i, 1], p[i, 2] = p[i, 0] + part * dx, p[i, 1] + part * dy, p[i, 2] + part * dz
                for k in range(n_bones):
                    away[k, i] -= part * length
                    gap[k, i] -= part * length
            if pace * wanted <= tolerance:
                rests = True
                break
            if onward < 0.0:
                most *= CALMER
            pace = min(most, SLOWER * pace if onward < 0.0 else FASTER * pace)
        if not (lacking or rests):
            done[f] = iterations + 1
        unfinished[f] = lacking
    return n_missing


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
    gap: Floats,
    away: Floats,
    normal: Floats,
    used: Bools,
    matrix: Floats,
    right: Floats,
    work: Floats,
) -> int:
    """Add what bone k does to point i of string f, which is ``at``; return a block that is missing, or -1."""
    u, v, slope, side = work
    _apply(to_rest[k], at, u)
    _apply(fields.to_axes[k], u, v)
    layout = fields.layout[k]
    distance, lack = field_at(layout, fields.table, fields.values, v[0], v[1], v[2])
    gap[k, i] = away[k, i] = distance - tissue.within[k, f]
    if lack >= 0 or not gap[k, i] < 0.0 or distance == FAR:
        return lack
    track = tissue.track[f]
    j = memory.place[k, f, i] = _nearest_segment(track, u, memory.place[k, f, i])
    q0, q1 = track[j], track[j + 1]
    lx, ly, lz = q1[0] - q0[0], q1[1] - q0[1], q1[2] - q0[2]
    length2 = lx * lx + ly * ly + lz * lz
    part = ((u[0] - q0[0]) * lx + (u[1] - q0[1]) * ly + (u[2] - q0[2]) * lz) / length2
    beyond = not 0.0 < part < 1.0
    part = min(max(part, 0.0), 1.0)
    keep, rise = _along(tissue.thickness[k, f], j + part)
    rise = 0.0 if beyond else rise / length2
    gap[k, i] = distance - keep
    if memory.pushed[k, f, i] or gap[k, i] < 0.0:
        lack = slope_at(layout, fields.table, fields.values, v[0], v[1], v[2], slope)
        if lack >= 0:
            return lack
        used[k, i] = True
        m = fields.to_axes[k]
        for q in range(3):
            side[q] = m[0, q] * slope[0] + m[1, q] * slope[1] + m[2, q] * slope[2] - rise * (q1[q] - q0[q])
        n = normal[k, i]
        _turn_back(to_rest[k], side, n)
        _add_spring(n, PUSH, n[0] * at[0] + n[1] * at[1] + n[2] * at[2] - gap[k, i], matrix, right)
    else:
        away[k, i] = SURE * (gap[k, i] - (tissue.hold if tissue.guided[k, f] else 0.0))
    near = max(gap[k, i], 0.0) / tissue.hold
    if tissue.guided[k, f] and near < 1.0:
        hold = HOLD * (1.0 - near * near) ** 2 * _along(tissue.guide[k, f], j + part)[0]
        off = 0.0
        for q in range(3):
            side[q] = (1.0 - part) * tissue.aside[k, f, j, q] + part * tissue.aside[k, f, j + 1, q]
            off += side[q] * (u[q] - q0[q] - part * (q1[q] - q0[q]))
        _turn_back(to_rest[k], side, slope)
        target = slope[0] * at[0] + slope[1] * at[1] + slope[2] * at[2] - off
        _add_spring(slope, hold, target, matrix, right)
    return -1


@kernel
def _bed(
    p: Floats,
    to_rest: Floats,
    course: Floats,
    forces: Floats,
    give: float,
    matrices: Floats,
    right: Floats,
    work: Floats,
) -> None:
    """Add what the tissue along a string's course, as it moves with one bone, does to the string ``p``.

    The tissue at each point of the course has hold of the place of the string that is nearest to it, and acts
    across the string: along it there is only the string's own tension. The two points beside that place share
    the force.
    """
    at, force, along, rest = work
    for j in range(1, len(course) - 1):
        size2 = 0.0
        for q in range(3):
            rest[q] = course[j, q] - to_rest[q, 3]
            size2 += forces[j, q] ** 2
        if size2 == 0.0:
            continue
        _turn_back(to_rest, rest, at)
        _turn_back(to_rest, forces[j], force)
        i = _nearest_segment(p, at, j)
        part = _part_of_segment(p[i], p[i + 1], at)
        stiffness, length2, ahead = np.sqrt(size2) / give, 0.0, 0.0
        before, after = max(i - 1, 0), min(i + 2, len(p) - 1)
        for q in range(3):
            place = (1.0 - part) * p[i, q] + part * p[i + 1, q]
            # Of the two segments at a point neither counts alone: which one is nearer rounding would say.
            along[q] = (1.0 - part) * (p[i + 1, q] - p[before, q]) + part * (p[after, q] - p[i, q])
            force[q] += stiffness * (at[q] - place)
            length2 += along[q] * along[q]
            ahead += along[q] * force[q]
        if length2 == 0.0:
            continue
        for q in range(3):
            force[q] -= ahead / length2 * along[q]
        for end in range(2):
            share = part if end == 1 else 1.0 - part
            matrix, spring = matrices[i + end], share * stiffness
            matrix[0] += spring
            matrix[3] += spring
            matrix[5] += spring
            for q in range(3):
                right[i + end, q] += share * force[q] + spring * p[i + end, q]


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
    _add_spring(along, -bend, at, matrix, right)


@kernel
def _hold_in_ring(
    rings: Rings, ring: int, f: int, p: Floats, held: Floats, matrices: Floats, right: Floats
) -> None:
    """Add what holds a string's point on a ring's edge, where the string would pass outside of it.

    ``held`` (5,) is of this string and ring, from one iteration to the next: the point that is held, 0 for
    none, the direction into the ring, and how far in that the point is to be.
    """
    centre, normal, first, second = rings.frames[ring]
    corners = rings.corners[rings.offsets[ring] : rings.offsets[ring + 1]]
    outside = rings.outside[ring, f]
    i = int(held[0])
    if i == 0:
        i = _leaves_ring(centre, normal, first, second, corners, outside, p)
        if i == 0:
            return
        held[0] = i
    away = p[i] - centre
    s = away[0] * first[0] + away[1] * first[1] + away[2] * first[2]
    t = away[0] * second[0] + away[1] * second[1] + away[2] * second[2]
    u, v = nearest_on_polygon(corners, s, t)
    way = np.sqrt((u - s) ** 2 + (v - t) ** 2)
    inside = is_inside(corners, s, t)
    into = held[1:4]
    # A point on the edge does not tell which way is into the ring: that is known from the iteration before.
    if way > 0.0:
        into[:] = ((u - s) * first + (v - t) * second) / (-way if inside else way)
    at = into[0] * p[i, 0] + into[1] * p[i, 1] + into[2] * p[i, 2]
    held[4] = at + (-way if inside else way) - outside
    _add_spring(into, PUSH, held[4], matrices[i], right[i])
    at = normal[0] * centre[0] + normal[1] * centre[1] + normal[2] * centre[2]
    _add_spring(normal, PUSH, at, matrices[i], right[i])


@kernel
def _leaves_ring(
    centre: Floats, normal: Floats, first: Floats, second: Floats, corners: Floats, outside: float, p: Floats
) -> int:
    """Return the point next to where a string crosses a ring's plane outside of it; 0 where it does not.

    Of several crossings the one nearest to the centre counts.
    """
    nearest, point, s, t = np.inf, 0, 0.0, 0.0
    for i in range(len(p) - 1):
        a, b = p[i] - centre, p[i + 1] - centre
        low = a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2]
        high = b[0] * normal[0] + b[1] * normal[1] + b[2] * normal[2]
        if (low < 0.0) == (high < 0.0):
            continue
        part = low / (low - high)
        cross = a + part * (b - a)
        u = cross[0] * first[0] + cross[1] * first[1] + cross[2] * first[2]
        v = cross[0] * second[0] + cross[1] * second[1] + cross[2] * second[2]
        if u * u + v * v < nearest:
            nearest, s, t = u * u + v * v, u, v
            point = min(max(i if part < 0.5 else i + 1, 1), len(p) - 2)
    if point == 0 or is_inside(corners, s, t):
        return 0
    u, v = nearest_on_polygon(corners, s, t)
    return point if np.sqrt((u - s) ** 2 + (v - t) ** 2) > outside else 0


@kernel
def _let_go(held: Floats, y: Floats) -> None:
    """Let a point go that, solved, is farther in the ring than it has to be: the ring does not pull it."""
    i = int(held[0])
    if i > 0 and held[1] * y[i, 0] + held[2] * y[i, 1] + held[3] * y[i, 2] >= held[4]:
        held[0] = 0.0


@kernel
def _add_spring(n: Floats, stiffness: float, at: float, matrix: Floats, right: Floats) -> None:
    """Add the spring s (n . x - at)^2 / 2 to a point's matrix (xx, xy, xz, yy, yz, zz) and right side."""
    matrix[0] += stiffness * n[0] * n[0]
    matrix[1] += stiffness * n[0] * n[1]
    matrix[2] += stiffness * n[0] * n[2]
    matrix[3] += stiffness * n[1] * n[1]
    matrix[4] += stiffness * n[1] * n[2]
    matrix[5] += stiffness * n[2] * n[2]
    for q in range(3):
        right[q] += stiffness * at * n[q]


@kernel
def _solve(p: Floats, matrices: Floats, right: Floats, y: Floats) -> None:
    """Solve A_i y_i - y_{i-1} - y_{i+1} = r_i with the ends of p, by elimination; y may be of any size."""
    n = len(p)
    for q in range(3):
        right[1, q] += p[0, q]
        right[n - 2, q] += p[n - 1, q]
    for i in range(1, n - 1):
        h = matrices[i]
        if i > 1:
            w, z = matrices[i - 1], right[i - 1]
            for q in range(6):
                h[q] -= w[q]
            right[i, 0] += w[0] * z[0] + w[1] * z[1] + w[2] * z[2]
            right[i, 1] += w[1] * z[0] + w[3] * z[1] + w[4] * z[2]
            right[i, 2] += w[2] * z[0] + w[4] * z[1] + w[5] * z[2]
        a, b, c, d, e, g = h[0], h[1], h[2], h[3], h[4], h[5]
        size = 1.0 / (a * (d * g - e * e) + b * (c * e - b * g) + c * (b * e - c * d))
        h[0], h[1], h[2] = size * (d * g - e * e), size * (c * e - b * g), size * (b * e - c * d)
        h[3], h[4], h[5] = size * (a * g - c * c), size * (b * c - a * e), size * (a * d - b * b)
    for i in range(n - 2, 0, -1):
        h, z = matrices[i], right[i]
        if i < n - 2:
            for q in range(3):
                z[q] += y[i + 1, q]
        y[i, 0] = h[0] * z[0] + h[1] * z[1] + h[2] * z[2]
        y[i, 1] = h[1] * z[0] + h[3] * z[1] + h[4] * z[2]
        y[i, 2] = h[2] * z[0] + h[4] * z[1] + h[5] * z[2]


@kernel
def _apply(transform: Floats, point: Floats, moved: Floats) -> None:
    """Write a point (3,) moved by a 4 x 4 transform."""
    x, y, z = point[0], point[1], point[2]
    for q in range(3):
        moved[q] = transform[q, 0] * x + transform[q, 1] * y + transform[q, 2] * z + transform[q, 3]


@kernel
def _turn_back(transform: Floats, direction: Floats, turned: Floats) -> None:
    """Write a direction (3,) turned back by the rotation of a rigid transform."""
    x, y, z = direction[0], direction[1], direction[2]
    for q in range(3):
        turned[q] = transform[0, q] * x + transform[1, q] * y + transform[2, q] * z


@kernel
def _along(values: Floats, at: float) -> tuple[float, float]:
    """Return the quadratic B-spline of values (n,) at a place between 0 and n - 1, and its slope.

    Unlike straight lines between the values it has no kinks, in which a string would go to and fro.
    """
    n = len(values)
    m = min(int(at + 0.5), n - 1)
    t = at - m
    a, b, c = values[max(m - 1, 0)], values[m], values[min(m + 1, n - 1)]
    value = 0.5 * (0.5 - t) ** 2 * a + (0.75 - t * t) * b + 0.5 * (0.5 + t) ** 2 * c
    return value, (t - 0.5) * a - 2.0 * t * b + (0.5 + t) * c


@kernel
def _nearest_segment(track: Floats, u: Floats, start: int) -> int:
    """Return the segment of a polyline (n, 3) that a point is nearest to, going downhill from one on."""
    last = len(track) - 2
    j = start
    best = _distance2(track[j], track[j + 1], u)
    while j < last:
        ahead = _distance2(track[j + 1], track[j + 2], u)
        if not ahead < best:
            break
        j, best = j + 1, ahead
    while j > 0:
        behind = _distance2(track[j - 1], track[j], u)
        if not behind < best:
            break
        j, best = j - 1, behind
    return j


@kernel
def _part_of_segment(a: Floats, b: Floats, u: Floats) -> float:
    """Return how far along a segment the place nearest to a point is, in [0, 1]."""
    lx, ly, lz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    ahead = (u[0] - a[0]) * lx + (u[1] - a[1]) * ly + (u[2] - a[2]) * lz
    length2 = lx * lx + ly * ly + lz * lz
    return min(max(ahead / length2, 0.0), 1.0) if length2 > 0.0 else 0.0


@kernel
def _distance2(a: Floats, b: Floats, u: Floats) -> float:
    """Return the squared distance of a point from a segment."""
    lx, ly, lz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    px, py, pz = u[0] - a[0], u[1] - a[1], u[2] - a[2]
    part = _part_of_segment(a, b, u)
    px, py, pz = px - part * lx, py - part * ly, pz - part * lz
    squared: float = px * px + py * py + pz * pz
    return squared
