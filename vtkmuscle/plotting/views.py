"""Colours, simplified bones, and view directions on muscles with the least hidden area."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkAppendPolyData, vtkTriangleFilter, vtkTubeFilter

from vtkmuscle.core.mesh.normals import triangle_normals, vertex_normals
from vtkmuscle.core.mesh.surface import box_of, diagonal, survey, used_alone
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import blocks_of, output_of, points_of, polylines_from, polylines_of, triangles_of

#: Approximate number of triangles of all bones: a picture has fewer pixels per bone than triangles beyond.
TRIANGLES = 100_000
#: Least triangles of a bone or muscle, and most grid cells along an axis: cell numbers stay within 64 bits.
LEAST_TRIANGLES, _MOST_CELLS = 600, 400
#: Number of points spread over a surface: one for each hundred pixels of a picture of a million.
SPREAD = 10_000


@dataclass(frozen=True, eq=False)
class DrawnBone:
    """A bone of few triangles with its original's normals; ``solid`` if it is closed, facing outward."""

    points: Floats
    triangles: Ints
    normals: Floats
    solid: bool

    @cached_property
    def spread(self) -> Floats:
        """Points (k, 3) spread over the bone."""
        return spread_over(self.points, self.triangles)


class DrawnBones:
    """A scene's :class:`DrawnBone` by name, made on first use."""

    def __init__(self, bones: vtkMultiBlockDataSet) -> None:
        self._bones = bones

    def __getstate__(self) -> dict[str, dict[str, DrawnBone]]:
        return {"by_name": self.by_name}

    @cached_property
    def by_name(self) -> dict[str, DrawnBone]:
        """The bones by name."""
        blocks = blocks_of(self._bones)
        total = sum(block.GetNumberOfCells() for _, block in blocks)
        drawn = {}
        for name, block in blocks:
            points, triangles = used_alone(points_of(block), triangles_of(block, name))
            normals, report = vertex_normals(points, triangles), survey(points, triangles)
            solid = report.closed and report.oriented and report.volume > 0.0
            if total > TRIANGLES:
                wanted = max(int(len(triangles) * TRIANGLES / total), LEAST_TRIANGLES)
                kept, triangles = clustered(points, triangles, report.area, wanted)
                points, normals = points[kept], normals[kept]
            drawn[name] = DrawnBone(points, triangles, normals, solid)
        return drawn

    def spread(self, transforms: Mapping[str, Floats] | None = None) -> Floats:
        """Return points (k, 3) spread over all moved bones."""
        every = [np.zeros((0, 3))]
        for name, bone in self.by_name.items():
            moved = (transforms or {}).get(name, np.eye(4))
            every.append(bone.spread @ moved[:3, :3].T + moved[:3, 3])
        return np.vstack(every)


def spread_over(points: Floats, triangles: Ints) -> Floats:
    """Return reproducible points spread over a surface evenly by area."""
    doubled = np.linalg.norm(triangle_normals(points, triangles), axis=1)
    if not doubled.any():
        return points
    reached = np.cumsum(doubled)
    chosen = np.searchsorted(reached, (np.arange(SPREAD) + 0.5) / SPREAD * reached[-1])
    a, b, c = points[triangles[np.minimum(chosen, len(triangles) - 1)].T]
    u, v = np.random.default_rng(0).random((2, SPREAD, 1))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    return np.asarray(a + u * (b - a) + v * (c - a))


def clustered(points: Floats, triangles: Ints, area: float, wanted: int) -> tuple[Ints, Ints]:
    """Return ids of the kept points (n, 3), and about `wanted` triangles.

    The point closest to the mean of a grid cell replaces the cell's points (Rossignac and Borrel 1993,
    doi:10.1007/978-3-642-78114-8_29). ``area`` is the surface's area.
    """
    # A cell on the surface has about two triangles.
    cell = np.maximum(np.sqrt(2.0 * max(area, 1e-12) / wanted), np.ptp(points, axis=0) / _MOST_CELLS)
    cells = ((points - points.min(axis=0)) / cell).astype(np.int64) @ (_MOST_CELLS + 1) ** np.arange(3)
    _, cluster, counts = np.unique(cells, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(cluster, axis) / counts for axis in points.T], axis=1)
    nearest_last = np.argsort(((points - means[cluster]) ** 2).sum(axis=1), kind="stable")[::-1]
    kept = np.zeros(len(counts), dtype=np.int64)
    kept[cluster[nearest_last]] = nearest_last
    corners = cluster[triangles]
    return kept, corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]


IVORY = "#efe6d0"
MUSCLE_RED = "#8b1a1a"
#: A muscle around coloured fibres.
NEUTRAL = "#9a9590"
FIBRE_MAP = "coolwarm"
#: Positions across a muscle.
PLACE_MAP = "viridis"
#: Colours of Okabe and Ito, distinguishable for colour-blind readers, which bones and muscles use in turn.
PALETTE = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442")


class MuscleFrame(NamedTuple):
    """A muscle in a frame, with bones, fibres and title."""

    muscle: vtkPolyData
    transforms: Mapping[str, Floats]
    fibres: vtkPolyData | None = None
    label: str = ""


@dataclass(frozen=True, eq=False)
class View:
    """The view of a picture, in parallel projection with z up.

    ``direction`` (3,) is the unit vector to the eye, ``focus`` (3,) the centre of the picture [mm],
    ``half_height`` half its height [mm], ``aspect`` its width over height, and ``area`` its size [pixels].
    """

    direction: Floats
    focus: Floats
    half_height: float
    aspect: float
    area: float = 520_000.0

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the picture in pixels."""
        return round(math.sqrt(self.area * self.aspect)), round(math.sqrt(self.area / self.aspect))


def choose_view(muscles: Sequence[vtkPolyData], bones: Sequence[vtkMultiBlockDataSet]) -> View:
    """Return the view with the largest visible muscle area, for all frames.

    Directions around the vertical axis are compared by the muscle area that bones do not hide, then from
    slightly above and below. The frame encloses the muscles tightly.

    Parameters
    ----------
    muscles : sequence of vtkPolyData
        A muscle in 1 or more frames.
    bones : sequence of vtkMultiBlockDataSet
        The bones of the frames.
    """
    spread = ([_spread(block) for _, block in blocks_of(frame)] for frame in bones)
    return clearest_view(muscles, [np.vstack([np.zeros((0, 3)), *of_frame]) for of_frame in spread])


def clearest_view(muscles: Sequence[vtkPolyData], hiding: Sequence[Floats]) -> View:
    """Return the view of :func:`choose_view` from points (k, 3) on the bones of each frame."""
    everything = np.vstack([points_of(muscle) for muscle in muscles])
    cell = diagonal(everything) / 30.0
    pairs = [(_spread(muscle), points) for muscle, points in zip(muscles, hiding, strict=True)]

    def area(direction: Floats) -> float:
        axes = view_axes(direction)
        return float(sum(_visible_cells(axes @ seen.T, axes @ points.T, cell) for seen, points in pairs))

    azimuths = np.radians(np.arange(0.0, 360.0, 15.0))
    areas = np.array([area(_direction(azimuth, 0.0)) for azimuth in azimuths])
    # Among nearly equal views, the middle view wins.
    azimuth = azimuths[np.argmax(areas * sum(np.roll(areas, shift) for shift in range(-3, 4)))]
    # A view from above or below must show more, because it is harder to read.
    candidates = [_direction(azimuth, elevation) for elevation in np.radians([0.0, 20.0, -20.0])]
    areas = np.array([area(towards) * np.hypot(towards[0], towards[1]) for towards in candidates])
    return framed(candidates[areas.argmax()], everything)


def framed(direction: ArrayLike, points: Floats, *, margin: float = 0.12) -> View:
    """Return a view with a tight frame around points (n, 3).

    The direction to the eye is not vertical. The margin is relative to the size of the points; the aspect is
    between 0.5 and 1.6.
    """
    axes = view_axes(np.asarray(direction, dtype=np.float64))
    local = points @ axes.T
    low, high = box_of(local)
    width, height = (1.0 + 2.0 * margin) * np.maximum((high - low)[:2], 1e-9)
    aspect = float(np.clip(width / height, 0.5, 1.6))
    return View(axes[2], (low + high) / 2.0 @ axes, float(max(height, width / aspect)) / 2.0, aspect)


def fibre_surface(fibres: vtkPolyData) -> vtkPolyData:
    """Return fibres as tubes, in place of a muscle surface."""
    lines = polylines_from(polylines_of(fibres, "plotting: fibres"))
    sizes = {"Radius": 0.004 * lines.GetLength(), "NumberOfSides": 6, "Capping": True}
    return output_of(vtkTriangleFilter(), InputData=output_of(vtkTubeFilter(), InputData=lines, **sizes))


def merged(surfaces: Iterable[vtkPolyData]) -> vtkPolyData:
    """Return several surfaces as one."""
    append = vtkAppendPolyData()
    for surface in surfaces:
        append.AddInputData(surface)
    together: vtkPolyData = append.update().output
    return together


def _direction(azimuth: float, elevation: float) -> Floats:
    """Return the unit vector at two angles [radians]."""
    horizontal = math.cos(elevation)
    return np.array([horizontal * math.cos(azimuth), horizontal * math.sin(azimuth), math.sin(elevation)])


def view_axes(direction: Floats) -> Floats:
    """Return right, up and eye directions as a rotation (3, 3)."""
    x, y, z = direction / np.linalg.norm(direction)
    right = np.array([-y, x, 0.0])
    right /= np.linalg.norm(right)
    up = [-z * right[1], z * right[0], x * right[1] - y * right[0]]  # faster than np.cross
    return np.array([right, up, [x, y, z]])


def _spread(surface: vtkPolyData) -> Floats:
    return spread_over(points_of(surface), triangles_of(surface, "plotting"))


def _visible_cells(muscle: Floats, bones: Floats, cell: float) -> int:
    """Count the picture's cells with a muscle point (3, n) in front of all bone points (3, k)."""
    low = muscle[:2].min(axis=1)
    columns, rows = (np.floor((muscle[:2].max(axis=1) - low) / cell).astype(int) + 1).tolist()
    depth = np.full((2, columns * rows), -np.inf)
    for layer, (x, y, z) in zip(depth, (muscle, bones), strict=True):
        column, row = np.floor((x - low[0]) / cell), np.floor((y - low[1]) / cell)
        inside = np.flatnonzero((column >= 0) & (column < columns) & (row >= 0) & (row < rows))
        np.maximum.at(layer, (column[inside] * rows + row[inside]).astype(int), z[inside])
    return int((depth[0] > np.maximum(depth[1], -1e300)).sum())
