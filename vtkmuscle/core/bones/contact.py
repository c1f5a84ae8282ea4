"""Contact of a muscle with bones, by their signed distances."""

import warnings
from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from vtkmuscle.core.bones.bone import APART, Bone
from vtkmuscle.core.bones.lookup import STEEPEST, Field, distance_and_normal, distance_at, least_distance_at
from vtkmuscle.core.jit import kernel
from vtkmuscle.core.mesh.triangle_tree import MuscleContact, Neighbour
from vtkmuscle.core.motion.rigid import apply_transform, inverse, transform_point
from vtkmuscle.core.types import MOST_ROUNDS, ROUNDING, SAME, Bools, Floats

#: A muscle with more than this part of its free points in a bone at rest is swallowed by it: 14 muscles of
#: a hip, a knee and an arm have at most 0.17.
SWALLOWED = 0.9


#: The field of a bone, transforms (4, 4) to the bone's axes and back, and of each point the least distance
#: (n,), the position of the last look-up (n, 3), and the square (n,) of the distance that the point may go.
Seen: TypeAlias = tuple[Field, Floats, Floats, Floats, Floats, Floats]


class BoneBoxes:
    """The boxes of bones. They show the bones that points can meet.

    bones : mapping of int to Bone, bones by index among the transforms;
    margins : (k,)_like, distance at which each bone is met [mm].
    """

    def __init__(self, bones: Mapping[int, Bone], margins: Sequence[float]) -> None:
        self.indices = np.array(list(bones), dtype=np.int64)
        corners = np.array([bone.box for bone in bones.values()]).reshape(-1, 2, 3)
        self._middles = corners.mean(axis=1)[:, :, None]
        self._halves = np.ptp(corners, axis=1)[:, :, None] / 2.0 + np.reshape(margins, (-1, 1, 1))

    def moved(self, transforms: Floats, centre: Floats) -> tuple[Floats, Floats]:
        """Return the low and high corners (k, 3) of the moved boxes, relative to a centre (3,)."""
        mine = transforms[self.indices]
        middles = (mine[:, :3, :3] @ self._middles)[:, :, 0] + mine[:, :3, 3] - centre
        halves = (np.abs(mine[:, :3, :3]) @ self._halves)[:, :, 0]
        # A box without extent must not be missed for a rounding error.
        halves += ROUNDING * (np.abs(middles) + np.abs(centre) + halves)
        return middles - halves, middles + halves


@kernel
def boxes_met(p: Floats, free: Bools, low: Floats, high: Floats, met: Bools) -> None:
    """Write which boxes (k, 3) meet the box of the free points of p (n, 3)."""
    met[:] = True
    for axis in range(3):
        least, most = np.inf, -np.inf
        for i in range(len(p)):
            if free[i]:
                least, most = min(least, p[i, axis]), max(most, p[i, axis])
        for k in range(len(met)):
            met[k] = met[k] and least <= high[k, axis] and most >= low[k, axis]


class BoneContact:
    """Keeps the free points of a muscle out of bones.

    A point that is deeper in a bone than at rest goes along the gradient of :meth:`Bone.field
    <vtkmuscle.core.bones.bone.Bone.field>` to the point's depth at rest. The result depends on the points
    and the pose alone. Bones are looked up when a muscle first comes near the bones' boxes.

    bones : mapping of int to Bone, bones by index among the transforms;
    rest : (n, 3), points of the muscle at rest, in the scene [mm];
    free : (n,) bool, points that may be moved;
    clearance : distance that points keep from the bones [mm]; a point nearer at rest may come as near.

    Warns
    -----
    UserWarning
        If the surface of a met bone was mended, or if nearly all free points are in the bone at rest: the
        bone's frame or unit is not the muscle's.
    """

    def __init__(self, bones: Mapping[int, Bone], rest: Floats, free: Bools, clearance: float = 0.0) -> None:
        self.bones = tuple(bones.values())
        self.boxes = BoneBoxes(bones, [clearance] * len(bones))
        self.rest, self.free, self.clearance = rest, free, clearance
        #: Of each bone's number, as of the last pose in which the bone was met.
        self.seen: dict[int, Seen] = {}

    def levels(self, number: int) -> Floats:
        """Return each point's least distance (n,) from a bone [mm]."""
        bone = self.bones[number]
        if bone.solids.remarks:
            warnings.warn(f"{bone.name}: " + "; ".join(bone.solids.remarks), stacklevel=2)
        distance, _ = bone.field(self.rest, within=self.clearance)
        inside = int((distance[self.free] < 0.0).sum())
        if inside > SWALLOWED * self.free.sum():
            problem = f"{inside} of the muscle's {self.free.sum()} free points are inside at rest "
            problem += "and may stay as deep; check that bone and muscle are in the same frame and unit"
            warnings.warn(f"{bone.name}: {problem}", stacklevel=2)
        return np.minimum(distance, self.clearance)


class PoseContact:
    """The contact of a muscle in a pose.

    The pose has the transforms of the bones (b, 4, 4), rest to now, and other muscles. Positions are relative
    to a ``centre`` (3,) in the scene. After a look-up of its distance from a bone, a point is looked up again
    only after a move by the distance along with the bone, also in later poses.
    """

    def __init__(
        self, contact: BoneContact, transforms: Floats, neighbours: Sequence[Neighbour], centre: Floats
    ) -> None:
        self._contact, self._transforms, self._centre = contact, transforms, centre
        self._muscles = MuscleContact(neighbours, contact.free, centre)
        self._low, self._high = contact.boxes.moved(transforms, centre)
        self._seen: dict[int, Seen] = {}
        self._met, self._work = np.empty(len(contact.bones), dtype=np.bool_), np.empty((2, 3))
        self._waiting = np.empty(len(contact.rest), dtype=np.bool_)

    def keep_out(self, p: Floats) -> Bools:
        """Move positions (n, 3) out of muscles and bones, in place; return the moved points (n,)."""
        contact, moved = self._contact, self._muscles.keep_out(p)
        boxes_met(p, contact.free, self._low, self._high, self._met)
        for number, met in enumerate(self._met.tolist()):
            if met:
                seen, wanted = self._seen.get(number) or self._first_look(number), contact.free
                while _keep_out(*seen, p, wanted, self._waiting, moved, self._work):
                    contact.bones[number].fill(seen[0])
                    wanted = self._waiting.copy()
        return moved

    def _first_look(self, number: int) -> Seen:
        """Return the look-ups of a bone at the start of a pose."""
        contact, bone = self._contact, self._contact.bones[number]
        transform = np.array(self._transforms[contact.boxes.indices[number]])
        transform[:3, 3] -= self._centre
        back, n = transform @ bone.from_axes, len(contact.rest)
        field, last = bone.look_up(contact.clearance), contact.seen.get(number)
        if last is None:
            levels, seen_at, squares = contact.levels(number), np.zeros((n, 3)), np.zeros(n)
        else:
            levels, seen_at = last[3], apply_transform(back @ last[1], last[4])
            # A cell is far more than the rounding of a table of transforms.
            squares = np.maximum(np.sqrt(last[5]) - bone.cell, 0.0) ** 2
        self._seen[number] = contact.seen[number] = field, inverse(back), back, levels, seen_at, squares
        return self._seen[number]


@kernel
def _keep_out(
    field: Field, to_axes: Floats, back: Floats, levels: Floats, seen_at: Floats, squares: Floats, p: Floats,
    wanted: Bools, waiting: Bools, moved: Bools, work: Floats,
) -> bool:  # fmt: skip
    """Do the work of :meth:`PoseContact.keep_out` for a bone; return whether points wait for nodes.

    field to squares : see :data:`Seen`;  wanted : (n,), points to look up;  waiting : (n,), written: points
    with unknown nodes;  work : (2, 3), memory.
    """
    at, normal = work[0], work[1]
    for i in range(len(p)):
        waiting[i] = False
        if not wanted[i]:
            continue
        x, y, z = p[i, 0] - seen_at[i, 0], p[i, 1] - seen_at[i, 1], p[i, 2] - seen_at[i, 2]
        if x * x + y * y + z * z < squares[i]:
            continue
        before, level = field.lacking[0], levels[i]
        transform_point(to_axes, p, i, at)
        # A bound falls no faster than the way.
        distance, steepest = least_distance_at(field, at[0], at[1], at[2], max(level, 0.0), APART), 1.0
        if distance <= level:
            distance = least_distance_at(field, at[0], at[1], at[2], max(level, 0.0))
        if distance <= level:
            distance, steepest = distance_at(field, at[0], at[1], at[2]), STEEPEST
        deep = level - distance > SAME * field.cell  # not where it is unknown, NaN
        if deep:
            _push_out(field, at, level, normal)
        waiting[i] = field.lacking[0] > before
        if waiting[i]:
            continue
        room = max(distance - level, 0.0) / steepest
        squares[i] = room * room
        for k in range(3):
            seen_at[i, k] = p[i, k]
        if deep:
            for k in range(3):
                p[i, k] = back[k, 0] * at[0] + back[k, 1] * at[1] + back[k, 2] * at[2] + back[k, 3]
            moved[i] = True
    return bool(field.lacking[0] > 0)


@kernel
def _push_out(field: Field, at: Floats, level: float, normal: Floats) -> None:
    """Move a position (3,) along the gradient to a level, in place; normal : (3,), memory."""
    for _ in range(MOST_ROUNDS):
        depth = level - distance_and_normal(field, at, normal)
        if not abs(depth) > 0.5 * SAME * field.cell:
            break
        for k in range(3):
            at[k] += depth * normal[k]
