"""Even triangle meshes of implicit solids, solids of revolution and boxes."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import Delaunay
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkFiltersCore import vtkTriangleFilter
from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter

from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import checked_surface, output_of, with_settings
from vtkmuscle.data.label_images import evened, isosurface
from vtkmuscle.phantoms.implicit import Solid


def mesh_of(solid: Solid, spacing: float, n_triangles: int) -> tuple[Floats, Ints]:
    """Return the surface of a solid as even triangles, closed, manifold, facing outward.

    An isosurface on a grid of a spacing [mm], nowhere larger than the solid is thick, is decimated to about
    ``n_triangles``, then relaxed along the surface of the solid.
    """
    # The field on a grid: exact near the surface, elsewhere right in sign.
    stride = 4
    origin = solid.lower - 1.5 * spacing
    coarse_shape = np.ceil((solid.upper - solid.lower + 3.0 * spacing) / (stride * spacing)).astype(int) + 1
    coarse = solid.values(_grid(origin, coarse_shape, stride * spacing).reshape(-1, 3)).reshape(coarse_shape)
    shape = stride * (coarse_shape - 1) + 1
    fine: Floats = coarse[np.ix_(*((np.arange(count) + stride // 2) // stride for count in shape))]
    # Fields are no steeper than a distance, the coarse point is at most half a stride away per axis, and
    # points matter up to one edge from the surface.
    near = np.abs(fine) < (stride / 2.0 * np.sqrt(3.0) + 1.5) * spacing
    fine[near] = solid.values(_grid(origin, shape, spacing)[near])
    surface = isosurface(fine, origin, spacing)
    return evened(*surface, n_triangles, lambda points: solid.projected(points, steps=1))


def _grid(origin: Floats, shape: NDArray[np.int_], spacing: float) -> Floats:
    return np.asarray(origin + spacing * np.moveaxis(np.indices(tuple(shape)), 0, -1))


def solid_of_revolution(heights: ArrayLike, radii: ArrayLike, sides: int) -> tuple[Floats, Ints]:
    """Return a stack of regular polygons about the z axis, with flat ends, facing outward.

    Heights (k,) ascend, radii (k,) are of circumscribed circles [mm].
    """
    z, r = np.asarray(heights, dtype=np.float64), np.asarray(radii, dtype=np.float64)
    angles = 2.0 * np.pi * np.arange(sides) / sides
    across = np.outer(r, np.cos(angles)), np.outer(r, np.sin(angles))
    rings = np.dstack([*across, np.outer(z, np.ones(sides))])
    number = np.arange(len(z) * sides).reshape(len(z), sides)
    a, b = number[:-1], np.roll(number[:-1], -1, axis=1)
    d, c = number[1:], np.roll(number[1:], -1, axis=1)
    falling = (np.add.outer(np.arange(len(z) - 1), np.arange(sides)) % 2)[..., None, None] == 0
    first = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2)
    second = np.stack([np.stack([a, b, d], -1), np.stack([b, c, d], -1)], axis=2)
    points, triangles = [rings.reshape(-1, 3)], [np.where(falling, first, second).reshape(-1, 3)]
    disc, faces = _disc(sides)
    for ring, border, step in ((0, number[0], -1), (-1, number[-1], 1)):
        inner = disc[:-sides]
        ids = np.concatenate([sum(map(len, points)) + np.arange(len(inner)), border])
        points.append(np.column_stack([r[ring] * inner, np.full(len(inner), z[ring])]))
        triangles.append(ids[faces[:, ::step]])
    return np.vstack(points), np.vstack(triangles).astype(np.int64)


def _disc(sides: int) -> tuple[Floats, Ints]:
    """Return points and triangles of a unit disc. Rings have about 6, 12, ... points, the border last."""
    points, rings = [np.zeros((1, 2))], max(sides // 6, 1)
    for ring in range(1, rings + 1):
        angles = 2.0 * np.pi * np.arange(count := sides * ring // rings) / count
        points.append(ring / rings * np.column_stack([np.cos(angles), np.sin(angles)]))
    disc = np.vstack(points)
    faces = Delaunay(disc).simplices  # counter-clockwise
    x, y = disc[faces].mean(axis=1).T
    outermost = np.linalg.norm(disc[faces], axis=2).max(axis=1).round(6)
    return disc, faces[np.lexsort((np.arctan2(y, x) % (2.0 * np.pi), outermost))]


def volume_of_revolution(heights: ArrayLike, radii: ArrayLike, sides: int) -> float:
    """Return the volume of :func:`solid_of_revolution`, a sum over frustums [mm^3]."""
    h, r = np.asarray(heights, dtype=np.float64), np.asarray(radii, dtype=np.float64)
    polygon = sides / 2.0 * np.sin(2.0 * np.pi / sides)
    return float(polygon / 3.0 * np.diff(h) @ (r[:-1] ** 2 + r[:-1] * r[1:] + r[1:] ** 2))


def box(lower: ArrayLike, upper: ArrayLike, spacing: float) -> tuple[Floats, Ints]:
    """Return a box of right-angled triangles with legs up to ``spacing`` [mm]."""
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    counts = np.ceil((high - low) / spacing - 1e-9).astype(int)
    grid = with_settings(vtkImageData(), Dimensions=counts + 1)
    squares = output_of(vtkGeometryFilter(), InputData=grid)
    places, triangles = checked_surface(output_of(vtkTriangleFilter(), InputData=squares), "box")
    return low + places / counts * (high - low), triangles
