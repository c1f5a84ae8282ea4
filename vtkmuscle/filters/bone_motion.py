"""BoneMotion: bones at a time of a rigid motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_DOUBLE, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.levers import MotionTwists
from vtkmuscle.core.motion.rigid import RigidMotion, transform_points
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import (
    add_arrays,
    array_of,
    empty_array,
    multiblock_from,
    set_field_array,
    shallow_copy,
)
from vtkmuscle.data.moving_bones import TWIST, bones_of
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter


class _RestPose:
    """Bones at rest, with the identity as ``Transform``."""

    def __init__(self, data: vtkMultiBlockDataSet, where: str) -> None:
        self.blocks = {
            name: add_arrays(shallow_copy(bone), fields={"Transform": np.eye(4).reshape(-1)})
            for name, bone in bones_of(data, where).items()
        }
        self.still = multiblock_from(self.blocks)
        self._vectors: dict[tuple[str, str], Floats] = {}

    def moved(self, name: str, transform: Floats) -> vtkPolyData:
        """Return a bone moved rigidly, with its normals and vectors."""
        bone = shallow_copy(self.blocks[name])
        turn = transform.copy()
        turn[:3, 3] = 0.0
        points = vtkPoints()
        points.SetData(self._moved(name, "points", self.blocks[name].GetPoints().GetData(), transform))
        bone.SetPoints(points)
        for kind, attributes in (("point", bone.GetPointData()), ("cell", bone.GetCellData())):
            for get, put in (
                (attributes.GetNormals, attributes.SetNormals),
                (attributes.GetVectors, attributes.SetVectors),
            ):
                if (vectors := get()) is not None:
                    put(self._moved(name, f"{kind} {vectors.GetName()}", vectors, turn))
        return add_arrays(bone, fields={"Transform": transform.reshape(-1)})

    def _moved(self, bone: str, kind: str, vectors: Any, transform: Floats) -> Any:
        if (bone, kind) not in self._vectors:
            self._vectors[bone, kind] = np.array(vtk_to_numpy(vectors), dtype=np.float64)
        rest = self._vectors[bone, kind]
        array, values = empty_array(VTK_DOUBLE, rest.shape, vectors.GetName())
        transform_points(transform, rest, values)
        return array


class BoneMotion(Filter):
    """Move bones rigidly to their pose at the pipeline's time.

    The times of the motion are the time steps of the filter. The motion is interpolated between steps, and
    constant before the first and after the last step. Bones without a transform stay at rest and share their
    geometry with the input.

    Parameters
    ----------
    bones
        Named blocks of vtkPolyData, at rest.
    motion
        Transforms of the moving bones over time; None keeps all bones at rest.

    Attributes
    ----------
    output
        The bones, in the same named blocks, at the requested time; each with the field array ``Transform``
        (16, row major), rest to now. Moving bones also have ``Twist_COORDINATE`` (6), velocity at the origin
        and angular velocity per radian or millimetre, for each coordinate with a joint, or with a sole change
        about the time. Moment arms need the twists.

    Raises
    ------
    ValueError
        If the motion names a bone that is not among the blocks.

    Limitations
    -----------
    Bones are rigid. There is no extrapolation beyond the times of the motion. Without joints, coordinates
    that change together have no twists.

    Examples
    --------
    >>> from vtkmuscle.filters import BoneMotion
    >>> from vtkmuscle.phantoms import spindle_over_hinge
    >>> phantom = spindle_over_hinge()
    >>> bones = BoneMotion(bones=phantom.bones, motion=phantom.motion).apply(time=20.0)
    >>> bones[0].field_data["Transform"].shape
    (16,)
    """

    motion: Parameter[RigidMotion | None] = Parameter(RigidMotion, default=None)

    bones = InputPort(vtkMultiBlockDataSet, _RestPose)
    output = OutputPort(vtkMultiBlockDataSet)

    def __init__(self, **parameters: Any) -> None:
        #: A motion, and how its coordinates move the bones.
        self._twists: tuple[RigidMotion, MotionTwists] | None = None
        super().__init__(**parameters)

    def time_steps(self, inputs_information: Sequence[Any]) -> Sequence[float] | None:
        """Return the times of the motion."""
        return None if self.motion is None else [float(time) for time in self.motion.times]

    def execute(self, bones: _RestPose) -> vtkMultiBlockDataSet:
        """Return the moved bones."""
        transforms: dict[str, Floats] = {}
        twists: dict[str, dict[str, Floats]] = {}
        if self.motion is not None:
            assert self.request_time is not None  # the filter announces the motion's times
            if self._twists is None or self._twists[0] is not self.motion:
                self._twists = self.motion, MotionTwists(self.motion)
            transforms = self.motion.at(self.request_time)
            twists = self._twists[1].at(self.request_time)
        unknown = sorted(set(transforms) - set(bones.blocks))
        if unknown:
            raise InputError(
                "",
                f"the motion moves {', '.join(map(repr, unknown))}, but the bones are "
                f"{', '.join(map(repr, bones.blocks))}",
                "rename the block or the motion's bone",
            )
        # Bones that stay cost nothing, however many there are.
        result = vtkMultiBlockDataSet()
        result.CompositeShallowCopy(bones.still)
        for number, name in enumerate(bones.blocks):
            if name in transforms:
                moved = bones.moved(name, transforms[name])
                for coordinate, by_bone in twists.items():
                    set_field_array(moved, array_of(TWIST, coordinate), by_bone.get(name, np.zeros(6)))
                result.SetBlock(number, moved)
        return result
