"""BoneMotion: bones at a time of a rigid motion."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_DOUBLE, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.levers import MotionTwists
from vtkmuscle.core.motion.rigid import RigidMotion, transform_points
from vtkmuscle.core.types import Floats
from vtkmuscle.data import arrays
from vtkmuscle.data.arrays import add_arrays, array_of, multiblock_from, points_of, shallow_copy, vtk_array
from vtkmuscle.data.moving_bones import TWIST, rest_bones_of
from vtkmuscle.filters.base import Filter, InputPort, OutputPort, Parameter


def _rest_pose(data: vtkMultiBlockDataSet, where: str) -> dict[str, tuple[vtkPolyData, Floats]]:
    """Return bones at rest with the identity as ``Transform``, and points."""
    still, bones = {"Transform": np.eye(4).reshape(-1)}, rest_bones_of(data, where).surfaces.items()
    return {name: (add_arrays(shallow_copy(bone), fields=still), points_of(bone)) for name, bone in bones}


def _moved(bone: vtkPolyData, rest: Floats, transform: Floats) -> vtkPolyData:
    """Return a bone moved rigidly. Points at rest (n, 3), normals and vectors."""
    positions = arrays.with_settings(vtkPoints(), DataType=VTK_DOUBLE, NumberOfPoints=len(rest))
    transform_points(transform.copy(), rest, vtk_to_numpy(positions.GetData()))
    moved = arrays.with_settings(shallow_copy(bone), Points=positions)
    for attributes in (moved.GetPointData(), moved.GetCellData()):
        normals, vectors = attributes.GetNormals(), attributes.GetVectors()
        for replace, old in ((attributes.SetNormals, normals), (attributes.SetVectors, vectors)):
            if old is not None:  # not by name: an array may have none
                turned = vtk_to_numpy(old) @ transform[:3, :3].T
                replace(vtk_array(turned, old.GetName(), old.GetDataType()))
    return add_arrays(moved, fields={"Transform": transform.reshape(-1)})


#: How the coordinates of a motion move the bones, the same for all muscles of a scene.
_twists_of = lru_cache(maxsize=2)(MotionTwists)


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
        If a bone has moved, by its ``Transform``; if the motion names a bone that is not among the blocks.

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

    bones = InputPort(vtkMultiBlockDataSet, _rest_pose)
    output = OutputPort(vtkMultiBlockDataSet)

    def time_steps(self, inputs_information: Sequence[Any]) -> Sequence[float] | None:
        """Return the times of the motion."""
        return None if self.motion is None else [float(time) for time in self.motion.times]

    def execute(self, bones: dict[str, tuple[vtkPolyData, Floats]]) -> vtkMultiBlockDataSet:
        """Return the moved bones."""
        transforms: dict[str, Floats] = {}
        twists: dict[str, dict[str, Floats]] = {}
        if self.motion is not None:
            assert self.request_time is not None  # the filter announces the motion's times
            transforms = self.motion.at(self.request_time)
            twists = _twists_of(self.motion).at(self.request_time)
        if unknown := sorted(set(transforms) - set(bones)):
            moved, named = (", ".join(map(repr, names)) for names in (unknown, bones))
            problem = f"the motion moves {moved}, but the bones are {named}"
            raise InputError("", problem, "rename the block or the motion's bone")
        blocks = {name: bone for name, (bone, _) in bones.items()}
        for name, transform in transforms.items():
            blocks[name] = _moved(*bones[name], transform)
            for coordinate, by_bone in twists.items():
                add_arrays(blocks[name], fields={array_of(TWIST, coordinate): by_bone.get(name, np.zeros(6))})
        return multiblock_from(blocks)
