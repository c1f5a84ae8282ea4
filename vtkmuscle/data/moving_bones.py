"""Moving bones: their poses, and their rest geometry as obstacles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.bones.bone import depth_in
from vtkmuscle.core.collision.obstacles import DistanceObstacle, Obstacle, VoxelObstacle
from vtkmuscle.core.collision.voxels import DEFAULT_N_MAX
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import apply_transform, inverse, is_rigid
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import blocks_of, checked_surface, field_array, names_of
from vtkmuscle.data.muscle_geometry import Surface

#: Largest distance of a bone's points from where its transform puts them, as a part of its size and distance
#: from the origin (coordinates may be float32).
RIGIDITY_TOLERANCE = 1e-5
#: Points of a bone by which it is checked that it moved with its transform.
SAMPLE_SIZE = 100

#: What the field array of a bone's twist by a coordinate is called, before the coordinate's name.
TWIST = "Twist_"

#: The remedy where one of these arrays is missing.
_MADE_BY = "BoneMotion adds it"
#: The identity, as an array of the pipeline holds it.
_AT_REST = np.eye(4).tobytes()


def bones_of(data: vtkMultiBlockDataSet, where: str) -> dict[str, vtkPolyData]:
    """Return the bones of a data set by name; the i-th item is block i, to which ``FixedTo`` refers.

    Raises a ValueError if a block is not a vtkPolyData, two have the same name, or a point is not finite.
    """
    bones = _named_bones(data, where)
    for name, bone in bones.items():
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
            raise InputError(where, f"two blocks are named {name!r}", "give each bone a name of its own")
        bones[name] = block
    return bones


class MovingBones(NamedTuple):
    """Bones at a time.

    Attributes
    ----------
    surfaces : dict of str to vtkPolyData
        By name, in the order of blocks.
    transforms : (b, 4, 4) array
        Rest to now.
    twists : dict of str to (b, 6) array
        How each coordinate moves them now: velocity at the origin and angular velocity, per unit.
    """

    surfaces: dict[str, vtkPolyData]
    transforms: Floats
    twists: dict[str, Floats]

    @property
    def names(self) -> list[str]:
        """Names of the bones, in the order of their blocks."""
        return list(self.surfaces)


def moving_bones_of(data: vtkMultiBlockDataSet, where: str) -> MovingBones:
    """Return bones with their field arrays ``Transform`` and, where they have some, ``Twist_COORDINATE``.

    The points are not read. Raises a ValueError if a transform is missing or not rigid, or a twist is not six
    finite numbers.
    """
    bones = _named_bones(data, where)
    transforms = np.tile(np.eye(4), (len(bones), 1, 1))
    twists: dict[str, Floats] = {}
    for index, (name, bone) in enumerate(bones.items()):
        here = f"{where}, block {name!r}"
        if (values := field_array(bone, "Transform")) is None:
            raise InputError(here, "the field array 'Transform' is missing", _MADE_BY)
        if values.tobytes() != _AT_REST:  # as most bones are, most of the time
            if values.size != 16 or not is_rigid(values.reshape(4, 4)):
                raise InputError(
                    here,
                    "the field array 'Transform' must be 16 numbers, a rotation and a translation, row by "
                    "row, with last row 0 0 0 1",
                )
            transforms[index] = values.reshape(4, 4)
        for coordinate, array in names_of(TWIST, bone.GetFieldData()).items():
            twist = field_array(bone, array)
            if twist is None or twist.shape != (6,) or not np.isfinite(twist).all():
                raise InputError(here, f"the field array {array!r} must be six finite numbers", _MADE_BY)
            twists.setdefault(coordinate, np.zeros((len(bones), 6)))[index] = twist
    return MovingBones(bones, transforms, twists)


def fixed_points_of(muscle: Surface, bones: Sequence[str]) -> Ints:
    """Return the point array ``FixedTo`` of a muscle, (n,): -1 for a free point, else a bone's number.

    Raises a ValueError if there is none, or it has other numbers.
    """
    array = muscle.array("FixedTo")
    where = f"{muscle.where}, point array 'FixedTo'"
    if array.ndim != 1 or not np.isfinite(array).all() or (array != np.floor(array)).any():
        raise InputError(where, "it must be one whole number per point", "FixedPointDetector makes it")
    fixed_to = array.astype(np.int64)
    bad = fixed_to[(fixed_to < -1) | (fixed_to >= len(bones))]
    if len(bad):
        raise InputError(
            where,
            f"{bad[0]} is neither -1 (free) nor the index of one of the {len(bones)} bones "
            f"({', '.join(map(repr, bones))})",
            "detect the fixed points with these bones",
        )
    return fixed_to


class RestBones:
    """Bones in the rest pose as obstacles, made by taking back the motion of moving bones.

    Errors name the port ``bones``; `owner`, the class of the filter, is named in warnings.
    """

    def __init__(self, owner: str) -> None:
        self._owner = owner
        self._obstacles: dict[str, Obstacle] = {}
        #: State of each bone's points, and its transform, when they last agreed.
        self._checked: dict[str, tuple[int, bytes]] = {}

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The bones, in the order of their blocks."""
        return tuple(self._obstacles.values())

    def take(
        self,
        bones: MovingBones,
        *,
        collision: str,
        skin: float = 0.0,
        n_max: int = DEFAULT_N_MAX,
        n_equal: int | None = None,
    ) -> None:
        """Take the rest geometry from moving bones; obstacles of bones that are as before are kept.

        Take it from the same frame each time: from another one rounding differs, and with it the result.
        The collision is ``"voxel"``, with about `n_max` voxels of a bone, or `n_equal` along each axis; else
        distances, with the distance `skin` that points keep from the bones [mm].
        """
        kept, self._obstacles = self._obstacles, {}
        self._checked.clear()
        for index, (name, bone) in enumerate(bones.surfaces.items()):
            where = f"bones, block {name!r}"
            points, triangles = checked_surface(bone, where)
            rest = apply_transform(inverse(bones.transforms[index]), points)
            old, label = kept.get(name), f"{self._owner}: {where}"
            new: Obstacle
            if collision == "voxel":
                new = VoxelObstacle(index, rest, triangles, n_max=n_max, n_equal=n_equal, name=label)
            else:
                new = DistanceObstacle(index, rest, triangles, skin=skin, name=label)
            self._obstacles[name] = old if old is not None and new.same_as(old) else new

    def depths(self, points: Floats, transforms: Floats) -> Floats:
        """Return the depth (n,) [mm] of points (n, 3) in the triangles of the bones, 0 outside.

        The points are in the scene now; `transforms` (b, 4, 4) are those of the bones, rest to now.
        """
        return depth_in(((one.shape, transforms[one.bone]) for one in self.obstacles), points)

    def check(self, bones: MovingBones) -> None:
        """Check, at a sample of its points, that each bone is its rest geometry moved by its transform.

        Else its obstacle would be somewhere else than the bone.
        """
        for index, (name, bone) in enumerate(bones.surfaces.items()):
            transform = bones.transforms[index]
            state = bone.GetPoints().GetMTime(), transform.tobytes()
            if self._checked.get(name) == state:
                continue
            rest = self._obstacles[name].points
            sample = np.linspace(0, len(rest) - 1, min(len(rest), SAMPLE_SIZE)).astype(np.int64)
            expected = apply_transform(transform, rest[sample])
            off = np.inf
            if bone.GetNumberOfPoints() == len(rest):
                now = vtk_to_numpy(bone.GetPoints().GetData())[sample]
                off = float(np.abs(now - expected).max())
            scale = float(np.ptp(expected, axis=0).max()) + float(np.abs(expected).max())
            if not off <= RIGIDITY_TOLERANCE * scale:
                raise InputError(
                    f"bones, block {name!r}",
                    "its points are not its rest points moved by its 'Transform'",
                    "move bones with BoneMotion, or set collision to 'off'",
                )
            self._checked[name] = state
