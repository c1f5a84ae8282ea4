"""How near estimated attachments are to digitised ones: ``python benchmarks/estimated_attachments.py SCENE``.

SCENE is a scene.toml whose muscles have landmarks; without it the phantom hip is taken. Per muscle and bone:
true and estimated area that is fixed, intersection over union, how far the centroids are apart, and how
sure the estimate is.
"""

from __future__ import annotations

import sys

import numpy as np

from vtkmuscle import Scene, phantoms
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.data.arrays import checked_surface, point_array
from vtkmuscle.data.attachments import attachments_of
from vtkmuscle.filters import AttachmentEstimator, FixedPointDetector


def main(path: str | None) -> None:
    """Print the table of a scene."""
    scene = Scene.load(path) if path else Scene.from_phantom(phantoms.hip())
    bones = scene.bones_data()
    print(f"{'muscle':18} {'bone':10} {'true mm2':>9} {'est. mm2':>9}", end=" ")
    print(f"{'overlap':>8} {'centres mm':>10} {'sure':>5}")
    for name, muscle in scene.muscles.items():
        points, triangles = checked_surface(muscle.surface, name)
        thirds = np.repeat(np.linalg.norm(triangle_normals(points, triangles), axis=1) / 6.0, 3)
        weights = np.bincount(triangles.ravel(), thirds, len(points)) * scene.millimetres**2
        fixed = []
        for areas in (
            scene.attachments_data(name),
            guessed := AttachmentEstimator(muscle=muscle.surface, bones=bones).output,
        ):
            marked = FixedPointDetector().apply(muscle.surface, bones, areas)
            fixed.append(np.array(point_array(marked, "FixedTo", name)))
        sure = {area.bone: area.confidence for area in attachments_of(guessed, name)}
        for index, bone in enumerate(scene.bones):
            true, found = (array == index for array in fixed)
            if true.any() != found.any():
                print(f"{name:18} {bone:10} {'not found' if true.any() else 'wrong'}")
            if not (true.any() and found.any()):
                continue
            overlap = weights[true & found].sum() / weights[true | found].sum()
            centres = [np.average(points[mask], axis=0, weights=weights[mask]) for mask in (true, found)]
            apart = float(np.linalg.norm(centres[0] - centres[1])) * scene.millimetres
            areas_mm2 = f"{weights[true].sum():9.0f} {weights[found].sum():9.0f}"
            print(f"{name:18} {bone:10} {areas_mm2} {overlap:8.2f} {apart:10.1f} {sure[bone]:5.2f}")


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else None)
