"""What voxels cost: the phantom hip as labels against itself, and the time of 60 labels.

python benchmarks/bench_labels.py [accuracy] [paths] [time]
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from vtkmuscle import Scene
from vtkmuscle.core.mesh.normals import triangle_normals
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import signed_volume, survey
from vtkmuscle.data.arrays import blocks_of, checked_surface
from vtkmuscle.data.label_images import label_image
from vtkmuscle.filters import LabelSurfaces
from vtkmuscle.filters.attachment_estimator import estimated_areas
from vtkmuscle.labels import page

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from phantoms import hip, label_map

SIZES = {"1": 1.0, "1.5": 1.5, "1.5, rough": 1.5, "0.8, 0.8, 3": (0.8, 0.8, 3.0), "3": 3.0}


def far(surface, other):
    """Return how far 95 % of a surface's area is from another, at most [mm]."""
    away = np.abs(solids_of(*other).distances(surface[0][surface[1]].mean(axis=1)))
    areas, order = np.linalg.norm(triangle_normals(*surface), axis=1), np.argsort(away)
    return away[order][np.searchsorted(np.cumsum(areas[order]), 0.95 * areas.sum())]


def accuracy():
    """Print volume and surface by voxel size: the worst of five surfaces."""
    phantom = hip(detail=2.5)
    true = {**dict(blocks_of(phantom.bones)), **phantom.muscles}
    print("voxels [mm] | volume off [%] | surface to phantom [mm] | phantom to surface [mm]")
    for words, size in SIZES.items():
        image = label_map(phantom, spacing=size, noise=0.3 if "rough" in words else 0.0)
        rows = []
        for name, surface in blocks_of(LabelSurfaces()(image)):
            made, given = checked_surface(surface, name), checked_surface(true[name], name)
            volume = 100.0 * abs(signed_volume(*made) / signed_volume(*given) - 1.0)
            report = survey(*made)
            assert report.closed
            assert report.manifold
            rows.append((volume, far(made, given), far(given, made)))
        print(f"{words} | " + " | ".join(f"{value:.2f}" for value in np.max(rows, axis=0)))


def paths():
    """Print by how much path lengths and moment arms are off, areas being estimated in both."""
    phantom = hip(angles=range(0, 61, 5), detail=2.5)
    scene = replace(Scene.from_phantom(phantom), deformer="none")
    muscles = {
        name: replace(one, attachments=estimated_areas(one.surface, dict(scene.bones)))
        for name, one in scene.muscles.items()
    }
    true = replace(scene, muscles=muscles).run()
    print("voxels [mm] | muscle | lengths off [%] | arms off [mm]")
    for size in (1.0, 1.5, 3.0):
        image = label_map(hip(), spacing=size)
        page.read_labels = lambda *_, image=image, **__: [image]
        with tempfile.TemporaryDirectory() as folder:
            draft = page.draft_of_labels("hip")
            made = replace(Scene.load(draft.write(Path(folder))), deformer="none").run()
        for name in true.lengths:
            lengths = made.lengths[name].mean(axis=1) / true.lengths[name].mean(axis=1) - 1.0
            arms = [
                run.moment_arms()[name][coordinate].arms.mean(axis=1)
                for run, coordinate in ((made, "hip_flexion"), (true, "femur_angle"))
            ]
            off = np.abs(arms[0] - arms[1]).max()
            print(f"{size:g} | {name} | {100.0 * np.abs(lengths).max():.2f} | {off:.2f}")


def sixty():
    """Print the time and memory of 60 labels that fill 256 x 256 x 400 voxels: ellipsoids, close by."""
    shape, cells = np.array((400, 256, 256)), np.array((5, 4, 3))
    voxels = np.zeros(shape, dtype=np.uint8)
    step = shape / cells
    for number, cell in enumerate(np.ndindex(*cells), 1):
        low, high = (step * cell).astype(int), (step * (np.array(cell) + 1)).astype(int)
        axes = np.ogrid[tuple(slice(a, b) for a, b in zip(low, high, strict=True))]
        off = sum(
            ((axis - 0.5 * (a + b)) / (0.49 * (b - a))) ** 2
            for axis, a, b in zip(axes, low, high, strict=True)
        )
        voxels[tuple(slice(a, b) for a, b in zip(low, high, strict=True))][off < 1.0] = number
    image = label_image(voxels, np.eye(4), {})
    clock, processor = time.perf_counter(), time.process_time()
    surfaces = blocks_of(LabelSurfaces()(image))
    assert len(surfaces) == 60
    assert all(one.GetNumberOfCells() for _, one in surfaces)
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    took, processor = time.perf_counter() - clock, time.process_time() - processor
    triangles = sum(one.GetNumberOfCells() for _, one in surfaces)
    print(f"60 labels: {took:.1f} s, {processor:.1f} s of processor, {memory:.2f} GB, {triangles} triangles")


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    tasks = {"accuracy": accuracy, "paths": paths, "time": sixty}
    for name in sys.argv[1:] or tasks:
        tasks[name]()
