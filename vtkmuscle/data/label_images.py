"""Label images as vtkImageData; labels as smooth signed distances, and their surfaces as triangles."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D, vtkQuadricDecimation

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import vertex_normals
from vtkmuscle.core.mesh.surface import MOST_REPAIRED, edge_uses, point_components, survey, unique_edges
from vtkmuscle.core.motion.rigid import apply_transform, frame_at
from vtkmuscle.core.types import Bools, Floats, Ints
from vtkmuscle.data import arrays

#: Radius of the Gaussian [standard deviations]: 0.3 % of the weight is beyond.
_TRUNCATED = 3.0


@dataclass(frozen=True, eq=False)
class LabelField:
    """The smooth signed distance of a label's largest piece without cavities."""

    #: Smooth distance at the voxels (nk, nj, ni) of a box around the label, negative inside [mm].
    values: Floats
    #: From voxel indices (i, j, k) in the box to centre positions [mm].
    frame: Floats
    #: Signed distance to the boundary between voxels, not smooth [mm].
    boundary: Floats
    #: Volume of the voxels inside [mm^3].
    volume: float
    #: Voxels of each piece, largest first; only the first is taken.
    pieces: Ints
    #: Voxels of filled cavities, and at the image's border, which may cut the label.
    filled: int
    cut: int

    @property
    def spacing(self) -> Floats:
        """Size of a voxel (3,) [mm]."""
        return np.asarray(np.linalg.norm(self.frame[:3, :3], axis=0))

    def at(self, points: Floats) -> tuple[Floats, Floats]:
        """Return distances (n,) and gradients (n, 3) at points (n, 3)."""
        index = self._index(points)
        within = np.clip(index, 0.0, np.array(self.values.shape)[::-1] - 1.0)
        away = (index - within) @ self.frame[:3, :3].T
        beyond = np.linalg.norm(away, axis=1)
        distance = partial(_interpolated, self.values)
        value = distance(within) + beyond
        differences = [distance(within + step) - distance(within - step) for step in 0.5 * np.eye(3)]
        slope = np.column_stack(differences) @ np.linalg.inv(self.frame[:3, :3])
        outside = beyond > 0.0
        slope[outside] = away[outside] / beyond[outside, None]
        return value, slope

    def distances_from_boundary(self, points: Floats) -> Floats:
        """Return signed distances (n,) of points (n, 3) to the boundary [mm]."""
        return _interpolated(self.boundary, self._index(points))

    def projected(self, points: Floats) -> Floats:
        """Return points (n, 3) after a Newton step to distance 0."""
        value, slope = self.at(points)
        # A distance has slope 1, smaller at smoothed edges.
        squared = np.maximum(np.einsum("ij,ij->i", slope, slope), 0.25)
        return np.asarray(points - (value / squared)[:, None] * slope)

    def _index(self, points: Floats) -> Floats:
        """Return fractional voxel coordinates (i, j, k) of points (n, 3)."""
        return (points - self.frame[:3, 3]) @ np.linalg.inv(self.frame[:3, :3]).T


def _interpolated(values: Floats, index: Floats) -> Floats:
    return ndimage.map_coordinates(values, index.T[::-1], output=np.float64, order=1, mode="nearest")  # type: ignore[no-any-return]


def label_field(mask: Bools, frame: Floats, inner: tuple[slice, ...] = (), *, smoothing: float) -> LabelField:
    """Return a label's smooth signed distance, with the label's volume inside.

    The exact Euclidean distance to the nearest voxel of the other side is smoothed by a Gaussian of a
    standard deviation [voxels], and shifted to the level with the label's number of voxels. The mask (nk, nj,
    ni) is an image, or a box of an image; ``inner`` is its part away from the image's border.
    """
    # Voxels of a piece share a corner; voxels around a piece share a face.
    numbers, count = ndimage.label(mask, ndimage.generate_binary_structure(3, 3))
    sizes = np.bincount(numbers.ravel(), minlength=count + 1)[1:]
    piece = numbers == 1 + int(np.argmax(sizes))
    cut = int(piece.sum() - piece[inner].sum())
    box = ndimage.find_objects(piece.view(np.uint8))[0]
    margin = math.ceil(_TRUNCATED * smoothing) + 1  # for the Gaussian and a Newton step
    solid = np.pad(piece[box], margin)
    hollow = ndimage.label(~solid)[0] > 1  # the corner's part is the first
    solid |= hollow
    placed = frame @ frame_at([axis.start - margin for axis in box[::-1]])
    spacing = np.linalg.norm(frame[:3, :3], axis=0)
    boundary = ndimage.distance_transform_edt(~solid, sampling=spacing[::-1]).astype(np.float32)
    boundary -= ndimage.distance_transform_edt(solid, sampling=spacing[::-1]).astype(np.float32)
    # Distances run between voxel centres, with the boundary halfway.
    boundary = boundary - np.sign(boundary) * np.float32(0.5 * spacing.min())
    values = ndimage.gaussian_filter(boundary, smoothing, truncate=_TRUNCATED)
    inside = int(solid.sum())
    lowest = np.partition(values.ravel(), (inside - 1, inside))
    level = 0.5 * (lowest[inside - 1] + lowest[inside])
    volume, pieces = inside * float(abs(np.linalg.det(frame[:3, :3]))), np.sort(sizes)[::-1]
    return LabelField(values - np.float32(level), placed, boundary, volume, pieces, int(hollow.sum()), cut)


#: Field arrays of an image: label values and names.
VALUES, NAMES = "LabelValues", "LabelNames"
#: Largest label, of 16 bits; MuscleMap has labels up to 8172.
MOST = np.iinfo(np.uint16).max


def label_image(voxels: NDArray[np.integer], frame: Floats, names: Mapping[int, str]) -> vtkImageData:
    """Return an image of labels (nk, nj, ni). The frame is as of :class:`Label`; no name has commas."""
    spacing = np.linalg.norm(frame[:3, :3], axis=0)
    placed = {"Dimensions": voxels.shape[::-1], "Origin": frame[:3, 3].tolist(), "Spacing": spacing.tolist()}
    image: vtkImageData = arrays.with_settings(vtkImageData(), **placed)
    image.SetDirectionMatrix(*(frame[:3, :3] / spacing).ravel())
    arrays.add_arrays(image, points={"Label": voxels.ravel()})
    image.GetPointData().SetActiveScalars("Label")
    texts = [" ".join(name.replace(",", " ").split()) for name in names.values()]
    return arrays.add_arrays(image, fields={VALUES: np.array(list(names), dtype=np.int64), NAMES: texts})


@dataclass(frozen=True, eq=False)
class Label:
    """A label of an image: value, voxels, box. The frame (4, 4) maps voxels (i, j, k) to centres [mm]."""

    value: int
    voxels: NDArray[np.integer]
    box: tuple[slice, ...]
    frame: Floats

    def field(self, smoothing: float) -> LabelField:
        """Return the smooth signed distance, by :func:`label_field`."""
        placed = self.frame @ frame_at([axis.start for axis in self.box[::-1]])
        ends = ((axis.start, axis.stop, size) for axis, size in zip(self.box, self.voxels.shape, strict=True))
        inner = tuple(slice(int(a == 0), b - a - int(b == size)) for a, b, size in ends)
        return label_field(self.voxels[self.box] == self.value, placed, inner, smoothing=smoothing)


def labels_in(image: vtkImageData, where: str) -> dict[str, Label]:
    """Return an image's labels by name, ordered by value."""
    data = image.GetPointData()
    array = data.GetScalars() or data.GetArray(0)
    voxels = None if array is None else vtk_to_numpy(array).view()
    if voxels is None or voxels.ndim != 1 or not np.issubdtype(voxels.dtype, np.integer):
        raise InputError(where, "the image has no point scalars of whole numbers", "give a map of labels")
    least, most = int(voxels.min()), int(voxels.max())
    if least < 0 or not 0 < most <= MOST:
        problem = f"values go from {least} to {most}, but must be 0 (background) and labels from 1 to {MOST}"
        raise InputError(where, problem, "give a map of labels")
    voxels.setflags(write=False)
    voxels = voxels.reshape(image.GetDimensions()[::-1])
    values, texts = arrays.field_array(image, VALUES), arrays.field_strings(image, NAMES)
    names = {} if values is None else dict(zip(values.astype(int).tolist(), texts, strict=False))
    frame = np.array(image.GetIndexToPhysicalMatrix().GetData()).reshape(4, 4)
    frame[:3, 3] += frame[:3, :3] @ image.GetExtent()[::2]
    if not (np.isfinite(frame).all() and abs(np.linalg.det(frame)) > 0.0):
        raise InputError(where, "origin, spacing or direction are not finite, or flat", "correct the header")
    labels: dict[str, Label] = {}
    for value, box in enumerate(ndimage.find_objects(voxels), 1):
        name = names.get(value, f"label_{value}")
        if box is not None and name in labels:
            problem = f"labels {labels[name].value} and {value} are both called {name!r}"
            raise InputError(where, problem, "rename or remove one")
        if box is not None:
            labels[name] = Label(value, voxels, box, frame)
    return labels


#: Area of an equilateral triangle with unit edges.
EVEN = math.sqrt(3.0) / 4.0
#: Relaxations of triangles along a surface. In the phantom hip 99 % of the triangles have 0.37 of the area of
#: an even triangle without, 0.61 with 4, 0.63 with 8 and 0.65 with 16, for sides of equal mean square.
RELAXATIONS = 8
#: Newton steps along the normals to the label's volume: 2 suffice except for labels of a few voxels.
OFFSETS = 4
#: Least number of triangles of a label's surface: a sphere of 100 triangles has 95 % of the volume.
LEAST = 100
#: Longest label [mm], to detect wrong voxel sizes: the tallest person was 2720 mm.
LONGEST = 3000.0


def isosurface(values: Floats, origin: Floats, spacing: float) -> tuple[Floats, Ints]:
    """Return the outward zero surface of grid values."""
    placed = {"Dimensions": values.shape, "Origin": origin.tolist(), "Spacing": (spacing, spacing, spacing)}
    image = arrays.with_settings(vtkImageData(), **placed)
    # VTK's isosurface faces falling values: the changed sign makes the surface face outward.
    arrays.add_arrays(image, points={"inside": -values.ravel(order="F")})
    image.GetPointData().SetActiveScalars("inside")
    contour = vtkFlyingEdges3D()
    contour.SetValue(0, 0.0)
    surface = arrays.output_of(contour, InputData=image, ComputeNormals=False, ComputeScalars=False)
    return arrays.checked_surface(surface, "isosurface")


def evened(
    points: Floats, triangles: Ints, n_triangles: int, projected: Callable[[Floats], Floats]
) -> tuple[Floats, Ints]:
    """Return a closed surface with about `n_triangles` even triangles."""
    whole = points, triangles
    while n_triangles < len(whole[1]):
        points, triangles = decimated(*whole, n_triangles, regularity=0.05)
        # More triangles remain if decimation tears a thin part.
        if (edge_uses(triangles) == 2).all():
            break
        points, triangles = whole
        n_triangles *= 2
    edges = unique_edges(triangles)
    ends = np.vstack([edges, edges[:, ::-1]])
    shares = 1.0 / np.bincount(ends[:, 0], minlength=len(points))[ends[:, 0]]
    average = coo_array((shares, tuple(ends.T)), shape=(len(points),) * 2).tocsr()
    for _ in range(RELAXATIONS):
        shift = 0.7 * (average @ points - points)
        normals = vertex_normals(points, triangles)
        shift -= np.einsum("ij,ij->i", shift, normals)[:, None] * normals
        points = projected(points + shift)
    return projected(projected(points)), triangles


def decimated(
    points: Floats, triangles: Ints, n_triangles: int, *, regularity: float = 1e-6
) -> tuple[Floats, Ints]:
    """Return a surface of about `n_triangles` (Garland, Heckbert 1997, doi:10.1145/258734.258849).

    Without regularity, flat parts and straight prisms collapse in arbitrary order and leave slivers as long
    as the surface. The default moves the points of a real hip by 4e-6 mm; 0.05 gives even triangles.
    """
    settings = {"Regularization": regularity, "TargetReduction": 1.0 - n_triangles / len(triangles)}
    surface = arrays.surface_from(points, triangles)
    surface = arrays.output_of(vtkQuadricDecimation(), InputData=surface, Regularize=True, **settings)
    return arrays.checked_surface(surface, "the decimated surface")


def label_surface(field: LabelField, edge: float) -> tuple[Floats, Ints]:
    """Return points [mm] and triangles of a label's surface."""
    # A cubic grid of half an edge, but not coarser than the depth of a thin label.
    nodes = np.array(field.values.shape)
    longest = float(((nodes - 1) * field.spacing[::-1]).max())
    if longest > LONGEST:
        raise InputError("", f"the label is {longest / 1000.0:.3g} m long", "check the voxel size")
    pitch = max(min(0.5 * edge, -float(field.values.min())), float(field.spacing.min()))
    counts = np.ceil((nodes - 1) * field.spacing[::-1] / pitch).astype(int) + 1
    values = ndimage.zoom(field.values, counts / nodes, order=1)
    points, triangles = isosurface(values.T, np.zeros(3), 1.0)
    points *= ((nodes - 1) / (np.array(values.shape) - 1))[::-1]
    part = point_components(len(points), unique_edges(triangles))[triangles[:, 0]]
    used, ids = np.unique(triangles[part == np.argmax(np.bincount(part))], return_inverse=True)  # the largest
    points, triangles = apply_transform(field.frame, points[used]), ids.reshape(-1, 3)
    if np.linalg.det(field.frame) < 0.0:
        triangles = triangles[:, ::-1].copy()
    wanted = max(LEAST, math.ceil(survey(points, triangles).area / (EVEN * edge * edge)))
    points, triangles = evened(points, triangles, wanted, field.projected)
    for _ in range(OFFSETS):
        report = survey(points, triangles)
        points = points + (field.volume - report.volume) / report.area * vertex_normals(points, triangles)
    report = survey(points, triangles)
    bad = report.n_boundary_edges + report.n_nonmanifold_edges + report.n_misoriented_edges
    if bad or report.n_degenerate_triangles or report.n_components > 1:
        problem = f"the surface is not closed and manifold at {bad} edges"
    elif abs(report.volume - field.volume) > MOST_REPAIRED * field.volume:
        problem = f"the surface encloses {report.volume:.3g} mm^3, but the voxels {field.volume:.3g}"
    else:
        return points, triangles
    raise InputError("", problem, "smooth or remove the label in the segmentation program")
