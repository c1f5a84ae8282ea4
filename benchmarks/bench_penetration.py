"""Measure how far muscles end inside the bones of a hip over full flexion, against the bones' triangles.

Run as ``python benchmarks/bench_penetration.py [folder] [--modes NAME ...] [--muscles NAME ...]``, where the
folder holds ``scene.toml`` (by default that of ``VTKMUSCLE_DATA``, else ``../shared/data``, and there
``lhdl_hip``).

For each mode and muscle: over all frames, the largest 95th percentile and the largest depth of free points
that were outside the bones at rest, and the most of them that are inside. For all points of the iliacus, too,
how far they are drawn into the joint: how many lie within the acetabulum, which is the convex hull of the
pelvis's points that are nearer to the joint's centre than the radius of the head and 6 mm, and how deep.
"""

from __future__ import annotations

import argparse
import os
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
from scipy.spatial import ConvexHull

from vtkmuscle import Scene
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.motion.rigid import apply_transform, inverse
from vtkmuscle.data.arrays import checked_surface, point_array, points_of
from vtkmuscle.run import muscle_pipeline

#: What of a scene is replaced; settings of the deformer are added to the scene's.
MODES = {
    "default": {},
    "preview": {"quality": "preview"},
    "accurate": {"quality": "accurate"},
    "published": {"deformer": "pbd", "quality": "published"},
    "published, bone_push off": {
        "deformer": "pbd",
        "quality": "published",
        "solver": {"bone_push": "off"},
    },
}

#: Beyond the femoral head, up to this far from it, pelvis is acetabulum [mm].
CUP = 6.0


def hip(folder):
    """Return the scene, and the exact distance of each bone."""
    scene = Scene.load(folder / "scene.toml")
    return scene, {name: solids_of(*checked_surface(bone, "test")) for name, bone in scene.bones.items()}


class Acetabulum:
    """The socket of the hip joint, filled: a convex body fixed to the pelvis."""

    def __init__(self, scene):
        centre = np.asarray(scene.motion.centre, dtype=float)
        femur, pelvis = (points_of(scene.bones[name]) for name in ("femur_r", "pelvis"))
        # The head is round: its radius is the distance from the centre that most of its points have.
        distances = np.linalg.norm(femur - centre, axis=1)
        counts, edges = np.histogram(distances, bins=np.arange(10.0, 40.0, 0.5))
        self.radius = float(edges[counts.argmax()] + 0.25)
        cup = pelvis[np.linalg.norm(pelvis - centre, axis=1) < self.radius + CUP]
        hull = ConvexHull(cup)
        self.faces = np.unique(hull.equations, axis=0)

    def depth(self, points):
        """Return how deep points are in it [mm], negative outside."""
        return -(points @ self.faces[:, :3].T + self.faces[:, 3]).max(axis=1)


def measured(scene, name, distances, settings, acetabulum):
    """Yield, frame by frame, the depths of points, and how deep they are in the joint."""
    changed = {**settings, "solver": {**scene.solver, **settings.get("solver", {})}}
    pipeline = muscle_pipeline(replace(scene, **changed), name)
    rest = pipeline.fixed.update().output
    free = point_array(rest, "FixedTo", "") < 0
    counted = free & (np.max([d.depth(points_of(rest)) for d in distances.values()], axis=0) == 0.0)
    for time in scene.motion.times:
        began = perf_counter()
        out = pipeline.deformer.update(time=float(time)).output
        took = 1e3 * (perf_counter() - began)
        points, now = points_of(out), scene.motion.at(float(time))
        depths = [
            d.depth(apply_transform(inverse(now.get(bone, np.eye(4))), points[counted]))
            for bone, d in distances.items()
        ]
        joint = acetabulum.depth(apply_transform(inverse(now.get("pelvis", np.eye(4))), points[free]))
        yield np.max(depths, axis=0), joint, took


def main():
    """Measure all."""
    data = Path(os.environ.get("VTKMUSCLE_DATA", Path(__file__).parents[2] / "shared" / "data"))
    options = argparse.ArgumentParser()
    options.add_argument("folder", nargs="?", type=Path, default=data / "lhdl_hip")
    options.add_argument("--modes", nargs="+", choices=MODES, default=["default", "published"])
    options.add_argument("--muscles", nargs="+")
    chosen = options.parse_args()
    if not (chosen.folder / "scene.toml").is_file():
        raise SystemExit(f"no data: there is no scene.toml in {chosen.folder}")
    scene, distances = hip(chosen.folder)
    acetabulum = Acetabulum(scene)
    print(f"radius of the femoral head {acetabulum.radius:.1f} mm")
    for name in chosen.muscles or scene.muscles:
        for mode in chosen.modes:
            frames = list(measured(scene, name, distances, MODES[mode], acetabulum))
            depths = np.array([depth for depth, _, _ in frames])
            joint = np.array([inside for _, inside, _ in frames])
            p95 = np.percentile(depths, 95, axis=1)
            within, inside = (joint > 0).sum(axis=1), (depths > 0).sum(axis=1)
            print(
                f"{name:16s} {mode:16s} {len(frames)} frames, {depths.shape[1]} points: worst p95 "
                f"{p95.max():.3f} mm, worst max {depths.max():.3f} mm, at most {inside.max()} "
                f"inside; in the acetabulum {within[0]} at rest, at most {within.max()}, deepest "
                f"{joint[0].max():.2f} at rest, {joint.max():.2f} mm; median step "
                f"{np.median([ms for *_, ms in frames]):.1f} ms",
                flush=True,
            )


if __name__ == "__main__":
    main()
