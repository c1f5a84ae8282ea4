"""What of a muscle lies between its fibres and a bone, against known thicknesses."""

import numpy as np
from phantom_paths import COURSES, fibres_along, strung_phantom

from vtkmuscle.core.mesh.triangle_tree import triangle_tree
from vtkmuscle.core.paths.surroundings import directions_along, tissue_between


def between(make, across, outward, bone):
    made = strung_phantom(make)
    fibres = fibres_along(COURSES[make][0](), across, outward)
    shape = made.bones[made.names.index(bone)]
    muscle = triangle_tree(made.points, made.triangles)
    depth = muscle.depth(fibres.reshape(-1, 3)).reshape(fibres.shape[:2])
    found = tissue_between(fibres, directions_along(fibres), depth, shape, muscle)
    return made, fibres, found


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
    for make, bone in (
        ("lifting_strap", "proximal"),
        ("flexor_over_brim", "proximal"),
        ("slivered_tendon", "wedge"),
    ):
        _, _, (distance, _, thickness) = between(make, *COURSES[make][1:], bone)
        assert np.isfinite(thickness).all()
        assert (thickness <= np.maximum(distance, 0.0) + 1e-12).all() or (distance < 0.0).any()
        assert (thickness <= distance + 1e-12).all()


def test_a_fibre_that_heads_for_a_bone_has_what_lies_beside_it():
    """The end of the spindle is on the bone: what is ahead of the fibre does not count."""
    _, _, (distance, _, thickness) = between("spindle_over_ball", (12.0,), (0.0,), "distal")
    assert distance[0, -1] < 1.0
    assert thickness[0, 8] > 5.0
    assert thickness[0, -1] <= distance[0, -1] + 1e-12
