"""Simplified bones for pictures, made once per run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet

from vtkmuscle.core.mesh.normals import mean_normals, triangle_normals
from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import blocks_of, points_of, triangles_of

#: Approximate number of triangles of all bones: a picture has fewer pixels per bone than triangles beyond.
TRIANGLES = 100_000
#: Least triangles of a bone, and most grid cells along an axis: cell numbers stay within 64 bits.
_LEAST, _MOST_CELLS = 600, 400
#: Number of points spread over a surface.
SPREAD = 10_000


@dataclass(frozen=True, eq=False)
class DrawnBone:
    """A bone at rest with few triangles, and the original's unit normals at the points (n, 3).

    ``solid`` says that the original is closed and faces outward, so that back faces are invisible.
    """

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
            points, triangles = points_of(block), triangles_of(block, name)
            facing = triangle_normals(points, triangles)
            normals = mean_normals(facing, triangles, len(points))
            report = survey(points, triangles)
            solid = report.closed and report.oriented and report.volume > 0.0
            if total > TRIANGLES:
                wanted = max(int(len(triangles) * TRIANGLES / total), _LEAST)
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
    samples: Floats = a + u * (b - a) + v * (c - a)
    return samples


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
    a, b, c = cluster[triangles.T]
    return kept, cluster[triangles][(a != b) & (b != c) & (c != a)]
