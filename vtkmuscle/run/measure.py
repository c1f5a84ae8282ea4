"""Measures of a deformed muscle against rest and bones."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.bones.bone import Bone, depth_in
from vtkmuscle.core.mesh import surface as surfaces
from vtkmuscle.core.mesh.polylines import sharp_turns
from vtkmuscle.core.mesh.rest_shape import beside_slivers, dihedral_angles
from vtkmuscle.core.mesh.triangle_tree import TriangleTree, tree_of_deformed
from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.core.paths.surroundings import LARGEST_STANDOFF
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import checked_surface, point_array, points_of, triangles_of
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.data.muscle_geometry import outward_tree
from vtkmuscle.run.verdict import CHECKS

#: An edge is folded back where its triangles are within 30 degrees of lying on each other; it counts where it
#: was at least 60 degrees off that at rest [degrees between their normals].
FOLDED, NOT_FOLDED = 150.0, 120.0


class MuscleMeasure:
    """Measures of a deformed muscle against rest and bones.

    ``rest`` has the point array ``FixedTo``, indices into the names of ``bones``; ``shapes`` are the bones
    with an inside, at rest.
    """

    def __init__(self, rest: vtkPolyData, bones: list[str], shapes: Mapping[str, Bone], to_mm: float) -> None:
        self._bones, self._shapes, self._millimetres = bones, shapes, to_mm
        self._rest = points_of(rest)
        self._triangles = triangles_of(rest, "muscle")
        self._fixed_to = np.array(point_array(rest, "FixedTo", "muscle"))
        edges = surfaces.edge_lengths(self._rest, surfaces.unique_edges(self._triangles))
        self.n_edges = max(int((edges > 0).sum()), 1)
        self._volume = surfaces.signed_volume(self._rest, self._triangles)
        self._sides = surfaces.side_products(self._rest, self._triangles)
        self._quads = surfaces.mesh_topology(len(self._rest), self._triangles).quads
        angles, defined = dihedral_angles(self._rest, self._quads)
        self._unfolded = defined & (np.abs(angles) < np.radians(NOT_FOLDED))
        self._unfolded &= ~beside_slivers(self._rest, self._quads)
        #: A bone presses on a path from no farther, through the muscle between [mm].
        self._standoff = LARGEST_STANDOFF * surfaces.mean_thickness(self._rest, self._triangles)
        self._rest_depths = self._depths_of_free(self._rest, {})
        self._fibre_rest_depths: Floats | float = 0.0
        self._bent: TriangleTree | None = None

    @property
    def size(self) -> float:
        """Cube root of the muscle's volume at rest [mm]."""
        return float(np.cbrt(abs(self._volume))) * self._millimetres

    def at_rest(self) -> dict[str, Any]:
        """Return the numbers of the muscle at rest."""
        fixed = {bone: int((self._fixed_to == i).sum()) for i, bone in enumerate(self._bones)}
        sizes: dict[str, Any] = {"points": len(self._rest), "triangles": len(self._triangles)}
        sizes["volume_mm3"] = self._volume * self._millimetres**3
        depths = self._sizes("penetration", self._rest_depths, count="penetrating_points")
        counts = {bone: count for bone, count in fixed.items() if count}
        return sizes | {"fixed_points": counts, "rest": depths}

    def frame(self, points: Floats, transforms: Mapping[str, Floats]) -> dict[str, Any]:
        """Return the numbers of a frame.

        See :data:`~vtkmuscle.run.report_values.DEFINITIONS`. ``points`` (n, 3) are the points of the
        deformed muscle, ``transforms`` the transforms of the bones since rest. The report of the deformer
        has the volume and the numbers of edges.
        """
        now, held = {bone: transforms.get(bone, np.eye(4)) for bone in self._bones}, points.copy()
        for i, bone in enumerate(self._bones):
            held[self._fixed_to == i] = apply_transform(now[bone], self._rest[self._fixed_to == i])
        sides = surfaces.side_products(points, self._triangles)
        least, greatest, areas = surfaces.triangle_stretches(self._sides, sides)
        misshapen = (greatest > CHECKS["long fibres"].failed) | (least < CHECKS["short fibres"].failed)
        angles, _ = dihedral_angles(points, self._quads)
        folded = self._unfolded & (np.abs(angles) > np.radians(FOLDED))
        depths, rest = self._depths_of_free(points, now), self._rest_depths
        grown = None if depths is None or rest is None else np.maximum(depths - rest, 0.0)
        share, off = float(areas[misshapen].sum() / areas.sum()), np.linalg.norm(points - held, axis=1)
        row: dict[str, Any] = {"misshapen_area": share, "folded_edges": int(folded.sum())}
        row |= self._sizes("penetration", depths, count="penetrating_points")
        row |= self._sizes("penetration_new", grown)
        return row | {"fixed_error_max_mm": float(off.max()) * self._millimetres}

    def overlap(self, points: Floats, muscles: Iterable[vtkPolyData]) -> dict[str, Any]:
        """Return the depth of points (n, 3) inside other muscles, by the names of the report."""
        depths = np.zeros(len(points))
        for other in muscles:
            np.maximum(depths, outward_tree(*checked_surface(other, "muscle")).depth(points), out=depths)
        inside = depths[depths > 0.0] if depths.any() else np.zeros(1)
        return self._sizes("overlap", inside, count="overlapping_points")

    def depths(self, points: Floats, transforms: Mapping[str, Floats]) -> Floats | None:
        """Return the depths (n,) of points (n, 3) in bones. 0 outside; None without a bone with an inside."""
        if not self._shapes:
            return None
        posed = ((bone, transforms.get(name, np.eye(4))) for name, bone in self._shapes.items())
        return depth_in(posed, points)

    def fibres(self, lines: Floats, offsets: Ints, points: Floats, depths: Floats | None) -> dict[str, Any]:
        """Return how far fibres leave the muscle, or enter bones since rest.

        ``depths`` (p,) are those of the fibres' points (p, 3), ``points`` (n, 3) the muscle's. The distance
        between points is that of the segments' middles: a coarse fibre cuts corners.
        """
        self._bent = tree_of_deformed(self._bent, points, self._triangles)
        middles = np.delete((lines[1:] + lines[:-1]) / 2.0, offsets[1:-1] - 1, axis=0)
        row: dict[str, Any] = {}
        for name, places in (("max", lines), ("between_max", middles)):
            outside = places[~self._bent.inside(places)]
            farthest = float(self._bent.nearest(outside)[2].max(initial=0.0))
            row[f"fibres_outside_{name}_mm"] = farthest * self._millimetres
        deeper = None
        if depths is not None:
            grown = np.maximum.reduceat(depths, offsets[:-1]) - self._fibre_rest_depths
            deeper = float(grown.max(initial=0.0)) * self._millimetres
        return row | {"fibres_penetration_new_max_mm": deeper}

    def hooked_paths(self, paths: Floats, rings: Sequence[AttachmentArea], at: Mapping[str, Floats]) -> float:
        """Return the share of paths (k, n, 3) that turn sharply where no bone or via ring presses."""
        path, positions, reach = sharp_turns(paths)
        reach += self._standoff
        for name, bone in self._shapes.items():
            here = apply_transform(inverse(at.get(name, np.eye(4))), positions)
            away = np.abs(bone.solids.distances(here)) > reach
            path, positions, reach = path[away], positions[away], reach[away]
        for ring in rings:
            landmarks = apply_transform(at.get(ring.bone, np.eye(4)), ring.landmarks)
            centre = landmarks.mean(axis=0)
            size = float(np.linalg.norm(landmarks - centre, axis=1).max())
            away = np.linalg.norm(positions - centre, axis=1) > size + reach
            path, positions, reach = path[away], positions[away], reach[away]
        hooked = len(np.unique(path))
        return hooked / len(paths) if hooked > 1 else 0.0

    def take_fibres_at_rest(self, fibre_points: Floats, offsets: Ints) -> None:
        """Take the depths at rest in bones of fibres with points (p, 3) and offsets (k + 1,)."""
        depths = self.depths(fibre_points, {})
        self._fibre_rest_depths = 0.0 if depths is None else np.maximum.reduceat(depths, offsets[:-1])

    def _depths_of_free(self, points: Floats, now: Mapping[str, Floats]) -> Floats | None:
        """Return the depths of free points in bones. None without such points or bones."""
        free = self._fixed_to < 0
        return self.depths(points[free], now) if free.any() else None

    def _sizes(self, name: str, depths: Floats | None, count: str = "") -> dict[str, Any]:
        """Return the largest and 95th percentile of depths [mm]. The number above 0 is by its name."""
        names = (f"{name}_max_mm", f"{name}_p95_mm", *([count] if count else []))
        if depths is None:
            return dict.fromkeys(names)
        size = depths * self._millimetres
        sizes = float(size.max()), float(np.percentile(size, 95)), int((depths > 0).sum())
        return dict(zip(names, sizes, strict=False))
