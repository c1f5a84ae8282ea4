"""Zero level of grid values, as even triangles."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_array, csr_array
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkFlyingEdges3D, vtkQuadricDecimation

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.normals import vertex_normals
from vtkmuscle.core.mesh.surface import edge_uses, point_components, survey, unique_edges
from vtkmuscle.core.motion.rigid import apply_transform
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import add_arrays, checked_surface, surface_from
from vtkmuscle.data.label_images import LabelField

#: Area of an equilateral triangle with unit edges.
EVEN = math.sqrt(3.0) / 4.0
#: Largest relative error of a surface's volume.
MOST_OFF = 0.01
#: Relaxations of triangles along a surface.
RELAXATIONS = 8
#: Newton steps along the normals to the label's volume: 2 suffice except for labels of a few voxels.
OFFSETS = 4
#: Least number of triangles of a label's surface: a sphere of 100 triangles has 95 % of the volume.
LEAST = 100
#: Longest label [mm], to detect wrong voxel sizes: the tallest person was 2720 mm.
LONGEST = 3000.0


def isosurface(values: Floats, origin: Floats, spacing: float) -> tuple[Floats, Ints]:
    """Return the outward zero surface of grid values."""
    image = vtkImageData()
    image.SetDimensions(*values.shape)
    image.SetOrigin(*origin)
    image.SetSpacing(spacing, spacing, spacing)
    # VTK's isosurface faces falling values: the changed sign makes the surface face outward.
    add_arrays(image, points={"inside": -values.ravel(order="F")})
    image.GetPointData().SetActiveScalars("inside")
    contour = vtkFlyingEdges3D()
    contour.SetInputData(image)
    contour.SetValue(0, 0.0)
    contour.ComputeNormalsOff()
    contour.ComputeScalarsOff()
    contour.Update()
    return checked_surface(contour.GetOutput(), "isosurface")


def evened(
    points: Floats, triangles: Ints, n_triangles: int, projected: Callable[[Floats], Floats]
) -> tuple[Floats, Ints]:
    """Return a closed surface with about `n_triangles` even triangles.

    `projected` maps points (n, 3) to the nearest points of the true surface.
    """
    whole = points, triangles
    while n_triangles < len(whole[1]):
        # Otherwise flat parts collapse in arbitrary order and leave slivers.
        points, triangles = decimated(*whole, n_triangles, regular=True)
        # More triangles remain if decimation tears a thin part.
        if (edge_uses(triangles) == 2).all():
            break
        points, triangles = whole
        n_triangles *= 2
    average = _neighbour_average(triangles, len(points))
    for _ in range(RELAXATIONS):
        shift = 0.7 * (average @ points - points)
        normals = vertex_normals(points, triangles)
        shift -= np.einsum("ij,ij->i", shift, normals)[:, None] * normals
        points = projected(points + shift)
    return projected(projected(points)), triangles


def decimated(
    points: Floats, triangles: Ints, n_triangles: int, *, regular: bool = False
) -> tuple[Floats, Ints]:
    """Return a surface with about `n_triangles` triangles.

    Garland, Heckbert 1997, *Surface simplification using quadric error metrics*, doi:10.1145/258734.258849.
    """
    decimation = vtkQuadricDecimation()
    decimation.SetRegularize(regular)
    decimation.SetInputData(surface_from(points, triangles))
    decimation.SetTargetReduction(1.0 - n_triangles / len(triangles))
    decimation.Update()
    return checked_surface(decimation.GetOutput(), "the decimated surface")


def _neighbour_average(triangles: Ints, n_points: int) -> csr_array:
    edges = unique_edges(triangles)
    ends = np.vstack([edges, edges[:, ::-1]])
    counts = np.bincount(ends[:, 0], minlength=n_points)
    return coo_array((1.0 / counts[ends[:, 0]], (ends[:, 0], ends[:, 1])), shape=(n_points,) * 2).tocsr()


def label_surface(field: LabelField, edge: float) -> tuple[Floats, Ints]:
    """Return points [mm] and triangles of a label's surface.

    Edges are about `edge` long [mm], or a voxel if a voxel is larger. ValueError if the surface is not
    closed, manifold and in a single piece, or if the volume differs by more than 1 %.
    """
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
    points, triangles = _largest(apply_transform(field.frame, points), triangles)
    if np.linalg.det(field.frame) < 0.0:
        triangles = triangles[:, ::-1].copy()
    area = survey(points, triangles).area
    wanted = max(LEAST, math.ceil(area / (EVEN * edge * edge)))
    points, triangles = evened(points, triangles, wanted, field.projected)
    for _ in range(OFFSETS):
        report = survey(points, triangles)
        points = points + (field.volume - report.volume) / report.area * vertex_normals(points, triangles)
    report = survey(points, triangles)
    bad = report.n_boundary_edges + report.n_nonmanifold_edges + report.n_misoriented_edges
    if bad or report.n_degenerate_triangles or report.n_components > 1:
        problem = f"the surface is not closed and manifold at {bad} edges"
    elif abs(report.volume - field.volume) > MOST_OFF * field.volume:
        problem = f"the surface encloses {report.volume:.3g} mm^3, but the voxels {field.volume:.3g}"
    else:
        return points, triangles
    raise InputError("", problem, "smooth or remove the label in the segmentation program")


def _largest(points: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Return the connected part with most triangles, and its points."""
    part = point_components(len(points), unique_edges(triangles))[triangles[:, 0]]
    kept = triangles[part == np.argmax(np.bincount(part))]
    used, ids = np.unique(kept, return_inverse=True)
    return points[used], ids.reshape(-1, 3)
