"""Images whose voxels have labels, as vtkImageData: made, and read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkStringArray
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix3x3

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.label_field import LabelField, label_field
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import field_array, set_field_array, set_point_array

#: Field arrays of an image: the values that have a name, and their names.
VALUES, NAMES = "LabelValues", "LabelNames"
#: Largest label: that of MuscleMap is 8172.
MOST = 65535


def label_image(voxels: NDArray[np.integer], frame: Floats, names: Mapping[int, str]) -> vtkImageData:
    """Return an image of labels.

    Parameters
    ----------
    voxels : (nk, nj, ni) int array
        Labels; 0 is none.
    frame : (4, 4) array
        From voxel numbers (i, j, k) to the places of their centres [mm]; voxels are right-angled.
    names : mapping of int to str
        By label.
    """
    image = vtkImageData()
    image.SetDimensions(*voxels.shape[::-1])
    spacing = np.linalg.norm(frame[:3, :3], axis=0)
    image.SetSpacing(*spacing)
    image.SetOrigin(*frame[:3, 3])
    direction = vtkMatrix3x3()
    direction.DeepCopy((frame[:3, :3] / spacing).ravel())
    image.SetDirectionMatrix(direction)
    set_point_array(image, "Label", voxels.ravel())
    image.GetPointData().SetActiveScalars("Label")
    set_field_array(image, VALUES, np.array(list(names), dtype=np.int64))
    words = vtkStringArray()
    words.SetName(NAMES)
    for name in names.values():
        words.InsertNextValue(name)
    image.GetFieldData().AddArray(words)
    return image


@dataclass(frozen=True, eq=False)
class Label:
    """A label of an image.

    Attributes
    ----------
    value : int
        That its voxels have.
    voxels : (nk, nj, ni) int array
        Of the whole image.
    box : tuple of slice
        Where in the image it is.
    frame : (4, 4) array
        From the numbers (i, j, k) of voxels of the image to the places of their centres [mm].
    """

    value: int
    voxels: NDArray[np.integer]
    box: tuple[slice, ...]
    frame: Floats

    def field(self, smoothing: float) -> LabelField:
        """Return its smooth signed distance; see :func:`~vtkmuscle.core.label_field.label_field`."""
        placed = self.frame.copy()
        placed[:3, 3] += self.frame[:3, :3] @ [axis.start for axis in self.box[::-1]]
        inner = tuple(
            slice(int(axis.start == 0), axis.stop - axis.start - int(axis.stop == size))
            for axis, size in zip(self.box, self.voxels.shape, strict=True)
        )
        return label_field(self.voxels[self.box] == self.value, placed, inner, smoothing=smoothing)


def labels_in(image: vtkImageData, where: str) -> dict[str, Label]:
    """Return the labels of an image by name, ``label_7`` where it says none, in the order of their values.

    Raises
    ------
    ValueError
        If the active point scalars, or the only ones, are not whole numbers from 0 to 65535; if all are 0;
        if two labels have one name; if the image is nowhere.
    """
    data = image.GetPointData()
    array = data.GetScalars() or data.GetArray(0)
    voxels = None if array is None else vtk_to_numpy(array).view()
    if voxels is None or voxels.ndim != 1 or not np.issubdtype(voxels.dtype, np.integer):
        raise InputError(where, "the image has no point scalars of whole numbers", "give a map of labels")
    least, most = int(voxels.min()), int(voxels.max())
    if least < 0 or not 0 < most <= MOST:
        problem = f"its values go from {least} to {most}, but labels are 1 to {MOST}, and 0 is none"
        raise InputError(where, problem, "give a map of labels")
    voxels.setflags(write=False)
    voxels = voxels.reshape(image.GetDimensions()[::-1])
    values, texts = field_array(image, VALUES), image.GetFieldData().GetAbstractArray(NAMES)
    names = {}
    if values is not None and isinstance(texts, vtkStringArray):
        names = {int(value): texts.GetValue(number) for number, value in enumerate(values)}
    matrix = image.GetIndexToPhysicalMatrix()
    frame = np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])
    frame[:3, 3] += frame[:3, :3] @ image.GetExtent()[::2]
    if not (np.isfinite(frame).all() and abs(np.linalg.det(frame)) > 0.0):
        raise InputError(where, "its origin, spacing and direction are not finite, or flat", "correct them")
    found: dict[str, Label] = {}
    for value, box in enumerate(ndimage.find_objects(voxels), 1):
        name = names.get(value, f"label_{value}")
        if box is not None and name in found:
            raise InputError(where, f"labels {found[name].value} and {value} are both called {name!r}")
        if box is not None:
            found[name] = Label(value, voxels, box, frame)
    return found
