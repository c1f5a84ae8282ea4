"""Images of labels as vtkImageData; a label as a smooth signed distance that keeps its volume."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Bools, Floats, Ints
from vtkmuscle.data.arrays import (
    field_array,
    field_strings,
    set_field_array,
    set_field_strings,
    set_point_array,
)

#: Free voxels around a label, within which the Gaussian and a Newton step end.
MARGIN = 4
#: Where a Gaussian is cut off [standard deviations].
_TRUNCATED = 3.0
#: Voxels of a piece share a corner; those around it share a face.
_TOUCHING = np.ones((3, 3, 3), dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class LabelField:
    """The smooth signed distance of a label's largest piece, its hollows filled.

    Attributes
    ----------
    values : (nk, nj, ni) float32 array
        Smooth distance at the voxels of a box around the label, negative inside [mm].
    frame : (4, 4) array
        From the numbers (i, j, k) of a voxel in the box to the position of its centre [mm].
    boundary : (nk, nj, ni) float32 array
        Distance from the label's own boundary, between voxels, negative inside, not smooth [mm].
    volume : float
        Volume of the voxels inside [mm^3].
    pieces : (p,) int array
        Number of voxels of each piece, of the largest, which is taken, first.
    filled : int
        Number of voxels of hollows, which were filled.
    cut : int
        Number of voxels at the border of the image, where the label may go on.
    """

    values: Floats
    frame: Floats
    boundary: Floats
    volume: float
    pieces: Ints
    filled: int
    cut: int

    @property
    def spacing(self) -> Floats:
        """Size of a voxel (3,) [mm]."""
        size: Floats = np.linalg.norm(self.frame[:3, :3], axis=0)
        return size

    def at(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the distance (n,) and its gradient (n, 3) at points (n, 3), in the box and beyond."""
        index = self._index(points)
        last = np.array(self.values.shape)[::-1] - 1.0
        within = np.clip(index, 0.0, last)
        away = (index - within) @ self.frame[:3, :3].T
        beyond = np.linalg.norm(away, axis=1)
        value = self._interpolated(self.values, within) + beyond
        slope = np.empty_like(index)
        for axis, step in enumerate(0.5 * np.eye(3)):
            slope[:, axis] = self._interpolated(self.values, within + step)
            slope[:, axis] -= self._interpolated(self.values, within - step)
        slope = slope @ np.linalg.inv(self.frame[:3, :3])
        outside = beyond > 0.0
        slope[outside] = away[outside] / beyond[outside, None]
        return value, slope

    def distances_from_boundary(self, points: Floats) -> Floats:
        """Return the distances (n,) [mm] of points (n, 3) from the label's boundary, negative inside."""
        return self._interpolated(self.boundary, self._index(points))

    def projected(self, points: Floats) -> Floats:
        """Return points (n, 3) moved along the gradient to distance 0, by one step of Newton's."""
        value, slope = self.at(points)
        # The slope of a distance is 1, less where it was smoothed over an edge.
        squared = np.maximum(np.einsum("ij,ij->i", slope, slope), 0.25)
        moved: Floats = points - (value / squared)[:, None] * slope
        return moved

    def _index(self, points: Floats) -> Floats:
        """Return the voxel coordinates (i, j, k) of points (n, 3), with fractions."""
        return (points - self.frame[:3, 3]) @ np.linalg.inv(self.frame[:3, :3]).T

    @staticmethod
    def _interpolated(values: Floats, index: Floats) -> Floats:
        places = index.T[::-1]
        found: Floats = ndimage.map_coordinates(values, places, output=np.float64, order=1, mode="nearest")
        return found


def label_field(mask: Bools, frame: Floats, inner: tuple[slice, ...] = (), *, smoothing: float) -> LabelField:
    """Return the smooth signed distance of a label, at the level at which it has the label's volume.

    That is the exact Euclidean distance to the nearest voxel of the other side, then a Gaussian. As many
    voxels as the label has are within the level.

    Parameters
    ----------
    mask : (nk, nj, ni) bool array
        The voxels of an image, or of a box of it, that have the label; one or more.
    frame : (4, 4) array
        From voxel numbers (i, j, k) in the mask to the positions of their centres [mm].
    inner : tuple of slice, optional
        The part of the mask that is not at the border of the image; all of it by default.
    smoothing : float
        Standard deviation of the Gaussian [voxels], >= 0.
    """
    if not mask.any():
        raise InputError("", "no voxel has this label")
    numbers, count = ndimage.label(mask, _TOUCHING)
    sizes = np.bincount(numbers.ravel(), minlength=count + 1)[1:]
    piece = numbers == 1 + int(np.argmax(sizes))
    cut = int(piece.sum() - piece[inner].sum())
    box = ndimage.find_objects(piece.view(np.uint8))[0]
    solid = np.pad(piece[box], MARGIN)
    outside, parts = ndimage.label(~solid)
    filled = 0
    if parts > 1:
        hollow = outside > 1  # the corner's part is the first
        filled = int(hollow.sum())
        solid |= hollow
    placed = frame.copy()
    placed[:3, 3] += frame[:3, :3] @ [axis.start - MARGIN for axis in box[::-1]]
    spacing = np.linalg.norm(frame[:3, :3], axis=0)
    boundary = _signed_distance(solid, spacing[::-1])
    values = boundary
    if smoothing > 0.0:
        values = ndimage.gaussian_filter(boundary, smoothing, truncate=_TRUNCATED)
    inside = int(solid.sum())
    lowest = np.partition(values.ravel(), (inside - 1, inside))
    level = 0.5 * (lowest[inside - 1] + lowest[inside])
    return LabelField(
        values - np.float32(level),
        placed,
        boundary,
        inside * float(abs(np.linalg.det(frame[:3, :3]))),
        np.sort(sizes)[::-1],
        filled,
        cut,
    )


def _signed_distance(solid: Bools, sampling: Floats) -> Floats:
    """Return the distance from the boundary between voxels, negative inside; `sampling` are their sizes."""
    outward = ndimage.distance_transform_edt(~solid, sampling=sampling).astype(np.float32)
    outward -= ndimage.distance_transform_edt(solid, sampling=sampling).astype(np.float32)
    # Both are from centre to centre of voxels, with the boundary halfway between.
    nearer: Floats = outward - np.sign(outward) * np.float32(0.5 * sampling.min())
    return nearer


#: Field arrays of an image: the values that have a name, and their names.
VALUES, NAMES = "LabelValues", "LabelNames"
#: Largest label: that of MuscleMap is 8172.
MOST = 65535


def label_image(voxels: NDArray[np.integer], frame: Floats, names: Mapping[int, str]) -> vtkImageData:
    """Return an image of labels (nk, nj, ni), where 0 is none; names are by label.

    The frame (4, 4) leads from voxel numbers (i, j, k) to the positions of their centres [mm]; voxels are
    right-angled.
    """
    image = vtkImageData()
    image.SetDimensions(*voxels.shape[::-1])
    spacing = np.linalg.norm(frame[:3, :3], axis=0)
    image.SetSpacing(*spacing)
    image.SetOrigin(*frame[:3, 3])
    image.SetDirectionMatrix(*(frame[:3, :3] / spacing).ravel())
    set_point_array(image, "Label", voxels.ravel())
    image.GetPointData().SetActiveScalars("Label")
    set_field_array(image, VALUES, np.array(list(names), dtype=np.int64))
    set_field_strings(image, NAMES, names.values())
    return image


@dataclass(frozen=True, eq=False)
class Label:
    """A label of an image: its value, the voxels (nk, nj, ni) and frame of the whole image, the label's box.

    The frame (4, 4) leads from the numbers (i, j, k) of voxels to the positions of their centres [mm].
    """

    value: int
    voxels: NDArray[np.integer]
    box: tuple[slice, ...]
    frame: Floats

    def field(self, smoothing: float) -> LabelField:
        """Return its smooth signed distance; see :func:`~vtkmuscle.data.label_images.label_field`."""
        placed = self.frame.copy()
        placed[:3, 3] += self.frame[:3, :3] @ [axis.start for axis in self.box[::-1]]
        inner = tuple(
            slice(int(axis.start == 0), axis.stop - axis.start - int(axis.stop == size))
            for axis, size in zip(self.box, self.voxels.shape, strict=True)
        )
        return label_field(self.voxels[self.box] == self.value, placed, inner, smoothing=smoothing)


def labels_in(image: vtkImageData, where: str) -> dict[str, Label]:
    """Return the labels of an image by name, or else as ``label_7``, in the order of their values.

    Raises a ValueError at `where` if the active point scalars, or the only ones, are not whole numbers from 0
    to 65535; if all are 0; if two labels have one name; if the image's frame is not finite, or flat.
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
    values, texts = field_array(image, VALUES), field_strings(image, NAMES)
    names = {} if values is None else dict(zip(values.astype(int).tolist(), texts, strict=False))
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
