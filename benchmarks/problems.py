"""What benchmarks work on: settling of meshes of any size, and the phantom hip with pieces of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
from calibration import torus

from vtkmuscle import Scene, phantoms
from vtkmuscle.core.mesh.rest_shape import RestShape
from vtkmuscle.core.mesh.surface import mesh_topology
from vtkmuscle.core.motion.rigid import RigidMotion, rotation_about
from vtkmuscle.core.skinning.carried_muscle import Settling
from vtkmuscle.data.arrays import add_arrays, blocks_of, multiblock_from, points_of, surface_from, with_points
from vtkmuscle.filters import BoneMotion, FixedPointDetector, PathDeformer, TautPaths
from vtkmuscle.pipelines import decompose, deform

#: Part of a torus's points that are fixed.
FIXED_PART = 20


def held_torus(n_triangles: int) -> tuple[Any, Any, Any, Any]:
    """Return points, inverse masses, topology and displaced points of a mesh of about so many triangles."""
    points, triangles = torus(n_triangles)
    mass = np.ones(len(points))
    mass[: len(points) // FIXED_PART] = 0.0
    moved = points + 0.01 * np.sin(np.arange(points.size)).reshape(-1, 3)
    return points, mass, mesh_topology(len(points), triangles), moved


def settling_of(n_triangles: int) -> Callable[[], object]:
    """Return the settling, in five rounds, of a mesh of about so many triangles."""
    points, mass, topology, moved = held_torus(n_triangles)
    settling = Settling(RestShape(points, topology), np.where(mass > 0.0, -1, 0), {})
    still = np.eye(4)[None]
    return lambda: settling.settle(moved, still, rounds=5)


def steps_of(n_triangles: int) -> Callable[[], object]:
    """Return two frames of a muscle of about so many triangles, one side of it turning."""
    points, triangles = torus(n_triangles)
    muscle, part = surface_from(points, triangles), len(points) // FIXED_PART
    held = np.full(len(points), -1, dtype=np.int32)
    held[:part], held[len(points) // 2 : len(points) // 2 + part] = 0, 1
    add_arrays(muscle, points={"FixedTo": held})
    turned = [rotation_about((0, 0, 0), (0, 0, 1), angle) for angle in (0.0, 1.0, 2.0)]
    far = with_points(muscle, points + np.array([0.0, 0.0, 100.0 * np.ptp(points)]))
    bones = multiblock_from({"still": far, "turning": far})
    motion = RigidMotion(np.arange(3.0), {"turning": np.array(turned)})
    posed = {"rest_bones": bones, "bones": BoneMotion(bones=bones, motion=motion)}

    def run() -> object:
        paths = TautPaths(rest_muscle=muscle, **posed)
        deformer = PathDeformer(muscle=muscle, paths=paths, **posed)
        deformer.update(time=1.0)
        return deformer.update(time=2.0).output

    return run


class Hip:
    """The phantom hip, and the pieces of it that are measured."""

    def __init__(self) -> None:
        self.phantom = phantoms.hip()
        self.muscle = self.phantom.muscles["iliacus"]
        self.areas = self.phantom.attachments["iliacus"]

    @cached_property
    def marked(self) -> Any:
        """The iliacus with its fixed points."""
        return FixedPointDetector()(self.muscle, self.phantom.bones, self.areas)

    @cached_property
    def hundred_fibres(self) -> Any:
        """Fibres of the iliacus, 100 of 15 segments."""
        return self.fibres(100)

    def fibres(self, n_fibres: int) -> Any:
        """Return new fibres."""
        return decompose(self.muscle, self.areas, n_fibres=n_fibres).update().output

    def frames(self, last: int, *, n_far: int = 0, **settings: Any) -> Any:
        """Deform the iliacus over so many frames of flexion, with more bones far away."""
        phantom = self.phantom
        blocks = dict(blocks_of(phantom.bones))
        bone = blocks["femur"]
        for number in range(n_far):
            blocks[f"far {number}"] = with_points(bone, points_of(bone) + 600.0 * (number + 1))
        motion = RigidMotion(phantom.motion.times, dict(phantom.motion.transforms))
        chain = deform(self.marked, multiblock_from(blocks), motion, fixing=None, **settings)
        return chain.update(time=float(motion.times[last])).output

    def scene(self, last: int, *, deformer: str = "paths", quality: str | None = None) -> Any:
        """Run the whole scene, its muscles, fibres and measures, over so many frames."""
        scene = replace(Scene.from_phantom(self.phantom, n_fibres=20), deformer=deformer)
        if quality is not None:
            scene = scene.with_settings(quality=quality)
        return scene.run(frames=slice(0, last + 1), figures=False, workers=1)
