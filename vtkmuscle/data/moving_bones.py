"""Bones at rest and moving bones, as arguments of filters."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.bones.bone import Bone, bone_of
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fixed_muscle import BoneRings, FixedMuscle
from vtkmuscle.core.motion.rigid import are_rigid
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import Polylines, blocks_of, checked_surface, field_array, field_strings, names_of
from vtkmuscle.data.muscle_geometry import Surface

#: Prefix of a bone's twist array, before the coordinate's name.
TWIST = "Twist_"

#: Field array with the names of the bones in the order of ``FixedTo``.
FIXED_TO_BONES = "FixedToBones"
#: Remedy for a missing array.
_MADE_BY = "BoneMotion adds it"


def bones_of(data: vtkMultiBlockDataSet, where: str) -> dict[str, vtkPolyData]:
    """Return bones at rest by name. In the order of ``FixedTo``; ValueError for bones that have moved."""
    bones = _named_bones(data, where)
    for name, bone in bones.items():
        transform = field_array(bone, "Transform")
        if transform is not None and not np.array_equal(transform.reshape(-1), np.eye(4).reshape(-1)):
            remedy = "connect the bones at rest, or remove the array 'Transform' from a new rest pose"
            raise InputError(f"{where}, block {name!r}", "the bone has moved", remedy)
        if bone.GetPoints() is not None and not np.isfinite(vtk_to_numpy(bone.GetPoints().GetData())).all():
            raise InputError(where, f"block {name!r} has points that are not finite", "correct its file")
    return bones


def _named_bones(data: vtkMultiBlockDataSet, where: str) -> dict[str, vtkPolyData]:
    bones: dict[str, vtkPolyData] = {}
    for name, block in blocks_of(data):
        if not isinstance(block, vtkPolyData):
            kind = "empty" if block is None else f"a {block.GetClassName()}"
            raise InputError(where, f"block {name!r} is {kind}, but a bone is a vtkPolyData")
        if name in bones:
            raise InputError(where, f"two blocks are named {name!r}", "give each bone a separate name")
        bones[name] = block
    return bones


class MovingBones(NamedTuple):
    """Bones at a time, by name in the order of blocks, and their transforms (b, 4, 4) from rest.

    Twists (b, 6) are by coordinate: velocity at the origin and angular velocity, per unit.
    """

    surfaces: dict[str, vtkPolyData]
    transforms: Floats
    twists: dict[str, Floats]


def moving_bones_of(data: vtkMultiBlockDataSet, where: str) -> MovingBones:
    """Return bones with their arrays ``Transform`` and ``Twist_COORDINATE``."""
    bones = _named_bones(data, where)
    transforms = np.empty((len(bones), 4, 4))
    twists: dict[str, Floats] = {}
    for index, (name, bone) in enumerate(bones.items()):
        here = f"{where}, block {name!r}"
        if (values := field_array(bone, "Transform")) is None:
            raise InputError(here, "the field array 'Transform' is missing", _MADE_BY)
        transforms[index] = values.reshape(4, 4) if values.size == 16 else np.nan
        for coordinate, array in names_of(TWIST, bone.GetFieldData()).items():
            twist = field_array(bone, array)
            if twist is None or twist.shape != (6,) or not np.isfinite(twist).all():
                raise InputError(here, f"the field array {array!r} must be six finite numbers", _MADE_BY)
            twists.setdefault(coordinate, np.zeros((len(bones), 6)))[index] = twist
    if not (rigid := are_rigid(transforms)).all():
        where = f"{where}, block {list(bones)[int(np.argmin(rigid))]!r}"
        problem = "'Transform' must be 16 numbers, a rotation and a translation, last row 0 0 0 1"
        raise InputError(where, problem)
    return MovingBones(bones, transforms, twists)


def fixed_points_of(muscle: Surface, bones: Sequence[str]) -> Ints:
    """Return a muscle's point array ``FixedTo`` (n,): bone index, -1 for free."""
    array = muscle.array("FixedTo")
    where = f"{muscle.where}, point array 'FixedTo'"
    if array.ndim != 1 or not np.isfinite(array).all() or (array != np.floor(array)).any():
        raise InputError(where, "must have a whole number per point", "run FixedPointDetector on the muscle")
    fixed_to = array.astype(np.int64)
    bad = fixed_to[(fixed_to < -1) | (fixed_to >= len(bones))]
    if len(bad):
        listed = ", ".join(map(repr, bones))
        problem = f"{bad[0]} is neither -1 (free) nor an index of the {len(bones)} bones ({listed})"
        raise InputError(where, problem, "detect the fixed points with these bones")
    detected = field_strings(muscle.data, FIXED_TO_BONES)
    for index, (name, bone) in enumerate(zip(detected, bones, strict=False)):
        if name != bone and index in fixed_to:
            problem = f"bone {index} was {name!r} at the detection, but is {bone!r}"
            raise InputError(where, problem, "detect the fixed points with these bones, in the same order")
    return fixed_to


def fixed_muscle(
    muscle: Surface, bones: Sequence[str], fibres: Polylines | None, rings: BoneRings | None = None, *,
    driven: bool = False,
) -> FixedMuscle:  # fmt: skip
    """Return a muscle at rest. InputError if nothing moves it, or if bones tear it.

    A muscle with ``rings``, even with none of them, is for paths alone, and nothing tears.
    """
    lines = None if fibres is None else (fibres.points, fibres.offsets)
    fixed = FixedMuscle(muscle.points, muscle.triangles, fixed_points_of(muscle, bones), lines, rings or ())
    corners = fixed.fixed_to[muscle.triangles]
    torn = rings is None and -1 < corners.min() < corners.max()
    if torn or ((corners < 0).all() and not driven):
        problem = "no point is fixed to a bone, so the muscle would not move"
        problem = "all points are fixed, to several bones, so the muscle would tear" if torn else problem
        raise InputError(muscle.where, problem, "detect fixed points by another method or distance")
    return fixed


@dataclass(frozen=True, eq=False)
class RestBones:
    """Bones at rest, by name in the order of blocks, with shapes made on first use."""

    surfaces: dict[str, vtkPolyData]
    where: str

    @cached_property
    def shapes(self) -> dict[int, Bone]:
        """The bones' shapes by index; ValueError for a bone without triangles."""
        named = [(f"{self.where}, block {name!r}", bone) for name, bone in self.surfaces.items()]
        return {i: bone_of(*checked_surface(bone, name), name) for i, (name, bone) in enumerate(named)}

    def check_same(self, moving: MovingBones) -> None:
        """Raise ValueError if names or order of rest and moving bones differ."""
        if list(self.surfaces) != list(moving.surfaces):
            own, theirs = (", ".join(map(repr, names)) for names in (self.surfaces, moving.surfaces))
            remedy = "connect the same bones to rest_bones and, through BoneMotion, to bones"
            raise InputError(self.where, f"the blocks are {own}, but the moving bones are {theirs}", remedy)


def rest_bones_of(data: vtkMultiBlockDataSet, where: str) -> RestBones:
    """Return bones at rest; raises as :func:`bones_of`."""
    return RestBones(bones_of(data, where), where)
