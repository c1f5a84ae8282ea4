"""What keeps points out of a bone by its signed distances, and which points need not be tested again."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.bones.lookup import Field, distance_at, least_distance_at, normal_at
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.tree_search import distance2_to_box
from vtkmuscle.core.motion.rigid import inverse, transform_point
from vtkmuscle.core.types import Bools, Floats


class Clearance:
    """How far points were from a bone when they were last tested, in the frame of the moving bone."""

    def __init__(self, n_points: int) -> None:
        #: Where each point was, and the squared way that it can go from there without meeting the skin [mm].
        self.seen_at: Floats = np.zeros((n_points, 3))
        self.squares: Floats = np.zeros(n_points)
        self._bone: Floats = np.eye(4)

    def begin(self, bone: Floats, step: Floats, x: Floats) -> None:
        """Begin a step; the ways of the points begin at their positions x (n, 3) of the previous frame [mm].

        The bone is now at a transform (4, 4), and has moved by a step (4, 4) since the previous frame.
        """
        _carry(bone @ inverse(self._bone), step, x, self.seen_at, self.squares)
        self._bone = bone


@kernel
def _carry(since: Floats, step: Floats, x: Floats, seen_at: Floats, squares: Floats) -> None:
    """Move the last known points with the bone, and drop those whose ways begin farther off.

    since, step : (4, 4), motions of the bone since they were seen, and in this step.
    """
    for i in range(len(squares)):
        if squares[i] == 0.0:
            continue
        a, b, c = seen_at[i, 0], seen_at[i, 1], seen_at[i, 2]
        way = 0.0
        for k in range(3):
            seen_at[i, k] = since[k, 0] * a + since[k, 1] * b + since[k, 2] * c + since[k, 3]
            start = step[k, 0] * x[i, 0] + step[k, 1] * x[i, 1] + step[k, 2] * x[i, 2] + step[k, 3]
            way += (start - seen_at[i, k]) ** 2
        if not way < squares[i]:
            squares[i] = 0.0


#: Height above the surface, in cells, up to which a path counts as touching it: a plate thinner than a cell
#: may be lost in the field, but leaves a valley that is no higher.
_ZONE = 0.5

#: Least step along a path, in cells.
_LEAST_STEP = 0.25

#: A point deeper than this is moved [cells]; the push ends within half of it.
_TOLERANCE = 1e-6

#: Most steps of a push; far more than one that converges takes.
_MOST_PUSHES = 20

#: Most times that a path is bent along the surface.
_MOST_SLIDES = 4


def resolve_distance_collisions(
    bone: Bone,
    now: Floats,
    step: Floats,
    x: Floats,
    p: Floats,
    free: Bools,
    *,
    skin: float = 0.0,
    allowance: Floats | None = None,
    clearance: Clearance | None = None,
) -> Bools:
    """Move the predicted positions p that are in a bone, or came through it, out; return which, (n,).

    In the bone's frame, a point nearer than the skin [mm] goes along the gradient to the skin. That is not
    where it belongs if it came through the bone. So the path from its previous position x (n, 3), taken along
    with the bone, to the predicted one is followed (sphere tracing, Hart 1996, doi:10.1007/s003710050084). If
    it goes down to the bone at one place and comes up where the surface faces the other way (by more than 90
    degrees), the point stops at the first contact and goes on along the tangent plane.

    now, step : (4, 4), of the bone to now, from its axes, and from the previous frame. Only ``free`` points
    (n,) with finite positions are moved. They may be deeper than the skin by their allowance (n,). Those that
    the clearance knows to be away from the bone are passed over; it is updated for the others. The bone must
    stand still from one call to the next.
    """
    known = Clearance(len(p)) if clearance is None else clearance
    moved, waiting = np.zeros(len(p), dtype=np.bool_), free.copy()
    to_rest, work = inverse(now), np.empty((11, 3))
    transforms = np.ascontiguousarray(now, dtype=np.float64), to_rest, to_rest @ step
    allowance = np.zeros(len(p)) if allowance is None else allowance
    while True:
        field = bone.look_up()
        kept = known.seen_at, known.squares, moved
        _resolve(field, *transforms, x, p, waiting, float(skin), allowance, *kept, work)
        if not bone.fill(field):
            return moved


@kernel
def _resolve(
    field: Field,
    now: Floats,
    to_rest: Floats,
    to_start: Floats,
    x: Floats,
    p: Floats,
    waiting: Bools,
    skin: float,
    allowance: Floats,
    seen_at: Floats,
    squares: Floats,
    moved: Bools,
    work: Floats,
) -> None:
    """Do the work of :func:`resolve_distance_collisions`; seen_at, squares, moved : changed in place.

    waiting : (n,), changed in place: points to be tested, afterwards those whose blocks were not known; work
    : (11, 3), working memory, of which the first eight rows are also that of the functions it calls.
    """
    start, end, wanted = work[8], work[9], work[10]
    margin = field.cell + skin
    for i in range(len(p)):
        if not waiting[i]:
            continue
        way = (p[i, 0] - seen_at[i, 0]) ** 2 + (p[i, 1] - seen_at[i, 1]) ** 2 + (p[i, 2] - seen_at[i, 2]) ** 2
        if way < squares[i]:
            waiting[i] = False
            continue
        transform_point(to_start, x, i, start)
        transform_point(to_rest, p, i, end)
        apart, finite = False, True
        for k in range(3):
            low, high = field.box[k] - margin, field.box[3 + k] + margin
            apart = apart or max(start[k], end[k]) < low or min(start[k], end[k]) > high
            finite = finite and np.isfinite(start[k]) and np.isfinite(end[k])
            wanted[k] = end[k]
        length = np.sqrt((end[0] - start[0]) ** 2 + (end[1] - start[1]) ** 2 + (end[2] - start[2]) ** 2)
        if not (finite and np.isfinite(length)):
            waiting[i] = False  # a path without a direction has no end either
            continue
        before = field.lacking[0]
        # The bone is not nearer than its box, nor than the overview tells.
        distance = np.sqrt(distance2_to_box(field.box, end[0], end[1], end[2]))
        if distance <= margin:
            distance = least_distance_at(field, end[0], end[1], end[2])
        if distance <= margin:
            distance = distance_at(field, end[0], end[1], end[2])
        level = skin - allowance[i]
        height = distance - level
        if not (apart or (height >= 0.0 and height - _ZONE * field.cell >= length)):
            _respond(field, start, end, level, work)
        if field.lacking[0] > before:
            continue
        waiting[i] = False
        # A cell, for what the interpolation between nodes can be wrong by.
        squares[i] = max(distance - margin, 0.0) ** 2
        for k in range(3):
            seen_at[i, k] = p[i, k]
        if end[0] != wanted[0] or end[1] != wanted[1] or end[2] != wanted[2]:
            for k in range(3):
                p[i, k] = now[k, 0] * end[0] + now[k, 1] * end[1] + now[k, 2] * end[2] + now[k, 3]
            moved[i] = True
            squares[i] = 0.0


@kernel
def _respond(field: Field, start: Floats, end: Floats, level: float, work: Floats) -> None:
    """Move the end of a path to where the bone lets it be; start and end : (3,), changed in place."""
    contact, normal, landing = work[0], work[1], work[2]
    slides = 0
    while _crosses(field, start, end, level, contact, landing, work):
        _push_out(field, contact, level, work[7])
        for k in range(3):
            start[k] = contact[k]
        slides += 1
        if slides > _MOST_SLIDES or not normal_at(field, contact, normal):
            for k in range(3):
                landing[k] = contact[k]
            break
        down = 0.0
        for k in range(3):
            down += normal[k] * (end[k] - contact[k])
        for k in range(3):
            end[k] -= min(down, 0.0) * normal[k]
    for k in range(3):
        end[k] = landing[k]


@kernel
def _push_out(field: Field, at: Floats, level: float, normal: Floats) -> None:
    """Move a position (3,) that is deeper than a level to the level, along the gradient, in place.

    normal : (3,), working memory.
    """
    depth = level - distance_at(field, at[0], at[1], at[2])
    if depth <= _TOLERANCE * field.cell:
        return
    for _ in range(_MOST_PUSHES):
        if abs(depth) <= 0.5 * _TOLERANCE * field.cell:
            break
        if not normal_at(field, at, normal):
            break
        for k in range(3):
            at[k] += depth * normal[k]
        depth = level - distance_at(field, at[0], at[1], at[2])


@kernel
def _crosses(  # noqa: PLR0912 -- one walk along a path
    field: Field, start: Floats, end: Floats, level: float, contact: Floats, landing: Floats, work: Floats
) -> bool:
    """Return True where the path from start to end goes through the bone, not only into it or past it.

    Sphere tracing: the distance at a position is a step that meets no surface. Where the path is low, the
    normal at which it began to go down is kept; if the path goes up again and the normal there is against
    that, it has come out on the other side. contact : (3,), written if True: where the path went down;
    landing : (3,), written if False: the end, pushed out of the bone.
    """
    at, normal, direction, down = work[3], work[4], work[5], work[6]
    for k in range(3):
        landing[k] = end[k]
    last = distance_at(field, end[0], end[1], end[2]) - level
    height = distance_at(field, start[0], start[1], start[2]) - level
    length = np.sqrt((end[0] - start[0]) ** 2 + (end[1] - start[1]) ** 2 + (end[2] - start[2]) ** 2)
    zone = _ZONE * field.cell
    if last >= 0.0 and max(last, height) - zone >= length:
        return False  # too short to meet the bone
    if last < 0.0:
        _push_out(field, landing, level, work[7])
    if not length > 0.0:
        return False
    for k in range(3):
        direction[k] = (end[k] - start[k]) / length
    t, t_end = _span_in_box(field, start, direction, length, max(level, 0.0) + field.cell)
    low, going_down, going_up = 0.0, False, False
    while t <= t_end:
        for k in range(3):
            at[k] = start[k] + t * direction[k]
        height = distance_at(field, at[0], at[1], at[2]) - level
        low = min(low, height)
        if (going_down or height < zone) and normal_at(field, at, normal):
            if _dot(normal, direction) < 0.0:
                if not going_down or (going_up and height >= 0.0):
                    going_down, going_up = True, False
                    for k in range(3):
                        contact[k], down[k] = at[k], normal[k]
                    low = height
            elif going_down:
                going_up = True
                if _dot(normal, down) < 0.0:
                    if low < 0.0:
                        _approach(field, contact, direction, level)
                    return True
        if height >= zone:
            going_down = going_up = False
        onward = min(t_end, t + max(_LEAST_STEP * field.cell, abs(height - zone)))
        if not onward > t:  # the end, or so far away that a step is lost in rounding
            break
        t = onward
    if not (going_down and last < 0.0 and normal_at(field, landing, normal)):
        return False
    if _dot(normal, down) >= 0.0:
        return False
    _approach(field, contact, direction, level)
    return True


@kernel
def _approach(field: Field, at: Floats, direction: Floats, level: float) -> None:
    """Move a position (3,) along a direction down to a level, in place."""
    for _ in range(_MOST_PUSHES):
        height = distance_at(field, at[0], at[1], at[2]) - level
        if height <= _TOLERANCE * field.cell:
            break
        for k in range(3):
            at[k] += height * direction[k]


@kernel
def _span_in_box(
    field: Field, start: Floats, direction: Floats, length: float, margin: float
) -> tuple[float, float]:
    """Return where a path enters and leaves the bone's box with a margin; in reverse order if it misses."""
    first, last = 0.0, length
    for k in range(3):
        low, high = field.box[k] - margin - start[k], field.box[3 + k] + margin - start[k]
        if direction[k] == 0.0:
            if low > 0.0 or high < 0.0:
                return 1.0, 0.0
        else:
            a, b = low / direction[k], high / direction[k]
            first, last = max(first, min(a, b)), min(last, max(a, b))
    return first, last


@kernel
def _dot(a: Floats, b: Floats) -> float:
    product: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product
