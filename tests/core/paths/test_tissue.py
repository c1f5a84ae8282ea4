"""What of a muscle lies between its fibres and a bone, against known thicknesses."""

import numpy as np
import pytest
from phantom_paths import COURSES, fibres_along, strung_phantom
from shapes import sphere

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.core.paths.surroundings import directions_along, tissue_between
from vtkmuscle.phantoms.meshing import box


def between(make, across, outward, bone):
    made = strung_phantom(make)
    fibres = fibres_along(COURSES[make][0](), across, outward)
    shape = made.bones[made.names.index(bone)]
    muscle = triangle_tree(made.points, made.triangles)
    depth = muscle.depth(fibres.reshape(-1, 3)).reshape(fibres.shape[:2])
    return made, fibres, tissue_between(fibres, directions_along(fibres), depth, shape, muscle)


def test_a_strap_on_a_cylinder_has_the_same_thickness_below_its_fibres_along_all_of_it():
    """Also before it comes to the cylinder: 5 mm below its middle, 3 mm less or more beside it."""
    outward = (3.0, 0.0, -3.0)  # to the right of its course is towards the axis
    _, fibres, (distance, away, thickness) = between("wrapping_cylinder", (0.0,), outward, "pulley")
    # The free end is attached by its face, in which a fibre ends.
    inner = slice(2, -2)
    for fibre, out in enumerate(outward):
        np.testing.assert_allclose(thickness[fibre, inner], 5.0 - out, atol=0.35)
    # On the cylinder nothing but that is between.
    wound = fibres[:, :, 1] > 5.0
    assert np.abs((distance - thickness)[wound]).max() < 0.6
    radial = fibres * [0.0, 1.0, 1.0] / np.linalg.norm(fibres[:, :, 1:], axis=2, keepdims=True)
    assert (np.einsum("fni,fni->fn", away, radial)[wound] > 0.99).all()


def test_tissue_is_never_more_than_the_distance():
    bones = {"lifting_strap": "proximal", "flexor_over_brim": "proximal", "slivered_tendon": "wedge"}
    for make, bone in bones.items():
        _, _, (distance, _, thickness) = between(make, *COURSES[make][1:], bone)
        assert np.isfinite(thickness).all()
        assert (thickness <= distance + 1e-12).all()


def test_tissue_below_a_surface_that_comes_near_slowly_is_measured_to_its_end():
    muscle, (points, triangles) = triangle_tree(*box((0.0, -50, -20), (100.0, 50, 0), 10.0)), sphere(5.0, 300)
    ball = Bone(np.add(points, [200.0, 0.0, 4.7]), triangles, "ball")
    fibre = np.array([[[10.0, y, -1.0] for y in (-5.0, 0.0, 5.0)]])
    _, away, thickness = tissue_between(fibre, directions_along(fibre), np.ones((1, 3)), ball, muscle)
    assert thickness[0, 1] == pytest.approx(-1.0 / away[0, 1, 2], rel=5e-3)  # 1 mm below the surface


def test_a_fibre_that_heads_for_a_bone_has_what_lies_beside_it():
    """The end of the spindle is on the bone: what is ahead of the fibre does not count."""
    _, _, (distance, _, thickness) = between("spindle_over_ball", (12.0,), (0.0,), "distal")
    assert distance[0, -1] < 1.0
    assert thickness[0, 8] > 5.0
    assert thickness[0, -1] <= distance[0, -1] + 1e-12
