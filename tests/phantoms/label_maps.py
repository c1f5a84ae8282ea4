"""Images of labels of a phantom."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_UNSIGNED_CHAR
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPolyData
from vtkmodules.vtkImagingStencil import vtkImageStencil, vtkPolyDataToImageStencil

from vtkmuscle.core.types import Bools, Floats, Ints
from vtkmuscle.data.arrays import blocks_of, points_of
from vtkmuscle.data.label_images import label_image
from vtkmuscle.phantoms import Phantom


def label_map(
    phantom: Phantom, *, spacing: ArrayLike = 1.5, noise: float = 0.0, seed: int = 0
) -> vtkImageData:
    """Return bones and muscles of a phantom as an image of labels: known surfaces behind voxels.

    A voxel has the label of the part that holds its centre; where two parts overlap, that of the bone, or of
    the muscle that comes first.
    """
    parts = {**dict(blocks_of(phantom.bones)), **phantom.muscles}
    size = np.broadcast_to(np.asarray(spacing, dtype=np.float64), 3)
    corners = np.vstack([points_of(part) for part in parts.values()])
    # A voxel and a half is free on either side, and no face of a phantom lies in a plane of centres.
    origin = corners.min(axis=0) - 1.37 * size
    shape = np.ceil((corners.max(axis=0) + 1.5 * size - origin) / size).astype(int) + 1
    voxels = np.zeros(shape[::-1], dtype=np.uint8)
    for value, part in reversed(list(enumerate(parts.values(), 1))):
        voxels[_inside(part, shape, origin, size)] = value
    random = np.random.default_rng(seed)
    for axis in range(3) if noise else ():
        for step in (1, -1):
            swapped = random.random(voxels.shape) < noise / 6.0
            voxels = np.where(swapped, np.roll(voxels, step, axis), voxels)
    frame = np.diag([*size, 1.0])
    frame[:3, 3] = origin
    return label_image(voxels, frame, dict(enumerate(parts, 1)))


def _inside(surface: vtkPolyData, shape: Ints, origin: Floats, size: Floats) -> Bools:
    """Return which voxels (nk, nj, ni) of an image of a shape (ni, nj, nk) have their centres inside."""
    image = vtkImageData()
    image.SetDimensions(*shape)
    image.SetOrigin(*origin)
    image.SetSpacing(*size)
    image.AllocateScalars(VTK_UNSIGNED_CHAR, 1)
    image.GetPointData().GetScalars().Fill(1)
    stencil = vtkPolyDataToImageStencil()
    stencil.SetInputData(surface)
    stencil.SetOutputOrigin(*origin)
    stencil.SetOutputSpacing(*size)
    stencil.SetOutputWholeExtent(image.GetExtent())
    cut = vtkImageStencil()
    cut.SetInputData(image)
    cut.SetStencilConnection(stencil.GetOutputPort())
    cut.SetBackgroundValue(0.0)
    cut.Update()
    inside: Bools = vtk_to_numpy(cut.GetOutput().GetPointData().GetScalars()).reshape(shape[::-1]) > 0
    return inside
