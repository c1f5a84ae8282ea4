"""BoneMotion: bones at a time of a rigid motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkCommonTransforms import vtkTransform
from vtkmodules.vtkFiltersGeneral import vtkTransformFilter

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.levers import MotionTwists
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import (
    add_arrays,
    array_of,
    blocks_of,
    multiblock_from,
    set_field_array,
    shallow_copy,
)
from vtkmuscle.data.moving_bones import TWIST, bones_of
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter


class BoneMotion(Filter):
    """Move bones to where a rigid motion has them at the pipeline's time.

    The filter announces the times of the motion as its time steps; between them the motion is
    interpolated, before the first and after the last it stands still. Bones that the motion does not name
    stay where they are and share their geometry with the input.

    Parameters
    ----------
    bones
        Named blocks of vtkPolyData, at rest.
    motion
        Transforms of the moving bones over time; None leaves all at rest.

    Attributes
    ----------
    output
        The bones, in the same named blocks, at the time asked for; each with the field array ``Transform``
        (16, row major): rest to now; those that move also with ``Twist_COORDINATE`` (6) by each coordinate
        whose joint is known, or that changes alone about this time: velocity at the origin and angular
        velocity, per radian or millimetre. By these there are moment arms.

    Raises
    ------
    ValueError
        If the motion names a bone that is not among the blocks.

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

    bones = InputPort(vtkMultiBlockDataSet)
    output = OutputPort(vtkMultiBlockDataSet)

    def __init__(self, **parameters: Any) -> None:
        #: The state of the input's blocks, the bones by name, and the output with all bones at rest.
        self._at_rest: tuple[list[Any], dict[str, vtkPolyData], vtkMultiBlockDataSet] | None = None
        #: A motion, and how its coordinates move the bones.
        self._twists: tuple[RigidMotion, MotionTwists] | None = None
        super().__init__(**parameters)

    def time_steps(self, inputs_information: Sequence[Any]) -> Sequence[float] | None:
        """Return the times of the motion."""
        return None if self.motion is None else [float(time) for time in self.motion.times]

    def execute(self, bones: vtkMultiBlockDataSet) -> vtkMultiBlockDataSet:
        """Return the moved bones."""
        state = [(name, block, block and block.GetMTime()) for name, block in blocks_of(bones)]
        if self._at_rest is None or self._at_rest[0] != state:
            self._at_rest = None
            blocks = bones_of(bones, "bones")
            # VTK modifies a block when it moves it: it moves these copies.
            blocks = {name: _moved(bone, None) for name, bone in blocks.items()}
            self._at_rest = state, blocks, multiblock_from(blocks)
        _, blocks, still = self._at_rest
        transforms: dict[str, Floats] = {}
        twists: dict[str, dict[str, Floats]] = {}
        if self.motion is not None:
            assert self.request_time is not None  # the filter announces the motion's times
            if self._twists is None or self._twists[0] is not self.motion:
                self._twists = self.motion, MotionTwists(self.motion)
            transforms = self.motion.at(self.request_time)
            twists = self._twists[1].at(self.request_time)
        unknown = sorted(set(transforms) - set(blocks))
        if unknown:
            raise InputError(
                "",
                f"the motion moves {', '.join(map(repr, unknown))}, but the bones are "
                f"{', '.join(map(repr, blocks))}",
                "rename the block or the motion's bone",
            )
        # Bones that stay cost nothing, however many there are.
        result = vtkMultiBlockDataSet()
        result.CompositeShallowCopy(still)
        for number, (name, bone) in enumerate(blocks.items()):
            if name in transforms:
                moved = _moved(bone, transforms[name])
                for coordinate, by_bone in twists.items():
                    set_field_array(moved, array_of(TWIST, coordinate), by_bone.get(name, np.zeros(6)))
                result.SetBlock(number, moved)
        return result


def _moved(bone: vtkPolyData, transform: Floats | None) -> vtkPolyData:
    """Return the bone moved rigidly, its normals with it, or sharing its geometry where it stays."""
    moved = bone
    if transform is not None:
        move = vtkTransform()
        move.SetMatrix(transform.reshape(-1))
        mover = vtkTransformFilter()
        mover.SetInputDataObject(bone)
        mover.SetTransform(move)
        mover.SetOutputPointsPrecision(vtkTransformFilter.DOUBLE_PRECISION)
        mover.Update()
        moved = mover.GetOutput()
    matrix = np.eye(4) if transform is None else transform
    return add_arrays(shallow_copy(moved), fields={"Transform": matrix.reshape(-1)})
