"""A label of an image as a smooth signed distance, which keeps the label's volume."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Bools, Floats, Ints

#: Voxels left free around a label: the Gaussian ends within them, and a Newton step does.
MARGIN = 4
#: A Gaussian counts up to so many of its standard deviations.
_TRUNCATED = 3.0
#: Pieces are of voxels that share a corner; what is around them, of voxels that share a face.
_TOUCHING = np.ones((3, 3, 3), dtype=np.bool_)


@dataclass(frozen=True, eq=False)
class LabelField:
    """The smooth signed distance of a label's largest piece, its hollows filled.

    Attributes
    ----------
    values : (nk, nj, ni) float32 array
        At the voxels of a box around the label, negative inside [mm].
    frame : (4, 4) array
        From the numbers (i, j, k) of a voxel in the box to the place of its centre [mm].
    boundary : (nk, nj, ni) float32 array
        The distance from the label's own boundary, between voxels, negative inside, not smooth [mm].
    volume : float
        Of the voxels inside [mm^3].
    pieces : (p,) int array
        Voxels of all pieces that the label has, the largest, which is taken, first.
    filled : int
        Voxels of hollows that were filled.
    cut : int
        Voxels at the border of the image: there the label may go on.
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
        """Return the distance (n,), and its gradient (n, 3), at points (n, 3); beyond the box it goes on."""
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
        """Return how far points (n, 3) are from the boundary between voxels, (n,) [mm], negative inside."""
        return self._interpolated(self.boundary, self._index(points))

    def projected(self, points: Floats, *, steps: int = 1) -> Floats:
        """Return points (n, 3) moved to where the distance is 0, along its gradient, by Newton's steps."""
        for _ in range(steps):
            value, slope = self.at(points)
            # As a distance the field is 1 steep, less where it was smoothed over an edge.
            squared = np.maximum(np.einsum("ij,ij->i", slope, slope), 0.25)
            points = points - (value / squared)[:, None] * slope
        return points

    def _index(self, points: Floats) -> Floats:
        """Return the voxel numbers, (i, j, k) and parts of them, of points (n, 3)."""
        return (points - self.frame[:3, 3]) @ np.linalg.inv(self.frame[:3, :3]).T

    @staticmethod
    def _interpolated(values: Floats, index: Floats) -> Floats:
        places = index.T[::-1]
        found: Floats = ndimage.map_coordinates(values, places, output=np.float64, order=1, mode="nearest")
        return found


def label_field(mask: Bools, frame: Floats, inner: tuple[slice, ...] = (), *, smoothing: float) -> LabelField:
    """Return the smooth signed distance of a label, at the level at which it has the label's volume.

    The distance to the nearest voxel of the other side, Euclidean and with the voxels' size, exact; then a
    Gaussian. What is inside of the level has as many voxels as the label.

    Parameters
    ----------
    mask : (nk, nj, ni) bool array
        An image's voxels, or those of a box of it, that have the label.
    frame : (4, 4) array
        From voxel numbers (i, j, k) in the mask to the places of their centres [mm].
    inner : tuple of slice, optional
        What of the mask is not at the border of the image, by axis; all of it by default.
    smoothing : float
        Standard deviation of the Gaussian [voxels], >= 0.

    Raises
    ------
    ValueError
        If no voxel has the label.
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
    """Return the distance to the other side's nearest voxel, negative inside, as if the step were between."""
    outward = ndimage.distance_transform_edt(~solid, sampling=sampling).astype(np.float32)
    outward -= ndimage.distance_transform_edt(solid, sampling=sampling).astype(np.float32)
    # Both count from voxel to voxel: half of the step is on either side of the boundary.
    nearer: Floats = outward - np.sign(outward) * np.float32(0.5 * sampling.min())
    return nearer
