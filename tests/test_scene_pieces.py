"""Scenes whose bones are of several closed pieces."""

from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv

from vtkmuscle import Scene, phantoms


def pieces_of(kind, femur):
    if kind == "out of reach":
        return femur + pv.Icosphere(radius=2.0, center=(-10.0, 0.0, -225.0), nsub=2)
    if kind == "specks":
        rng = np.random.default_rng(3)
        places = np.column_stack([rng.uniform(-60, 60, (200, 2)), rng.uniform(-250, 50, 200)])
        return femur.append_polydata(*[pv.Tetrahedron(radius=0.5, center=place) for place in places])
    centres = [(0.0, 0.0, -20.0), (0.0, 0.0, -60.0 if kind == "nested" else -25.0)]
    balls = [pv.Icosphere(radius=6.0 + number, center=at, nsub=2) for number, at in enumerate(centres)]
    if kind == "nested":
        balls[1] = balls[1].flip_faces()
    return femur.append_polydata(*balls)


@pytest.mark.parametrize("kind", ["out of reach", "specks", "nested", "overlapping"])
@pytest.mark.filterwarnings("ignore:.*facing|.*inside out:UserWarning")
def test_a_phantom_runs_whatever_closed_pieces_its_femur_has(kind):
    scene = Scene.from_phantom(phantoms.hip(detail=0.5))
    name = next(iter(scene.muscles))
    femur = pv.wrap(scene.bones["femur"])
    bones = {**scene.bones, "femur": pieces_of(kind, femur).extract_surface(algorithm=None)}
    muscles = {name: replace(scene.muscles[name], fibres=None)}
    result = replace(scene, bones=bones, muscles=muscles).run(frames="0:2", figures=False)
    for row in result.report["muscles"][name]["frames"]:
        assert abs(row["volume_ratio"] - 1.0) < 1e-6
