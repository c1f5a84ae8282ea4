"""Images of labels of a phantom."""

import numpy as np
import pyvista as pv
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonDataModel import vtkImageData

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
    grid = pv.ImageData(dimensions=shape, spacing=size, origin=origin)
    for value, part in reversed(list(enumerate(parts.values(), 1))):
        inside = pv.wrap(part).voxelize_binary_mask(reference_volume=grid)["mask"]
        voxels[inside.reshape(voxels.shape) > 0] = value
    random = np.random.default_rng(seed)
    for axis in range(3) if noise else ():
        for step in (1, -1):
            swapped = random.random(voxels.shape) < noise / 6.0
            voxels = np.where(swapped, np.roll(voxels, step, axis), voxels)
    frame = np.diag([*size, 1.0])
    frame[:3, 3] = origin
    return label_image(voxels, frame, dict(enumerate(parts, 1)))
