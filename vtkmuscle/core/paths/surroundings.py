"""What lies round a muscle's paths at rest, and holds them in every pose: bones, tissue, pressure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.mesh.triangle_tree import TriangleTree
from vtkmuscle.core.paths.bundles import bundle_of
from vtkmuscle.core.paths.tissue import directions_along, smoothed_along, tissue_between
from vtkmuscle.core.types import Floats, Ints

#: What is measured between a fibre and the bones is smoothed along the fibre by a Gaussian of this standard
#: deviation, as a part of its length: the thickness of the tissue, and the direction aside of the fibre.
THICKNESS_SMOOTHING, ASIDE_SMOOTHING = 1.0 / 32.0, math.sqrt(2.0) / 32.0

#: A bone's normal must be this much across a fibre, as a sine, to tell which way is aside; from half more on
#: it is sure.
LEAST_ACROSS = 0.3

#: Modulus by which tissue resists being sheared aside, as a part of the muscle's tension per area: that of
#: passive muscle across its fibres (:data:`vtkmuscle.core.paths.neighbours.MODULUS`).
MODULUS = 0.1

#: The layer of tissue between a path and a bone that it is held aside over is at least so thick, in
#: thicknesses of the muscle: its stiffness would be infinite where a fibre touches.
LEAST_LAYER = 0.25

#: Width of the bundle whose bow tissue outside of the muscle holds, in thicknesses of the muscle.
BUNDLE = 2.0


class Surroundings(NamedTuple):
    """The forces that hold each point of each path, by the bone that they move with.

    Attributes
    ----------
    standoff : (b, f, n) array
        Tissue between the point and the bone: no path comes nearer there [mm].
    force : (b, f, n, 3) array
        With which the point is pushed at rest, in the units of a path's springs [mm].
    stiffness : (b, f, n, 3, 3) array
        By which that force falls as the point leaves its place at rest, seen from the bone [1].
    bones : tuple of int
        Numbers of the bones that force and stiffness are by: those that there are, else those of the ends.
    """

    standoff: Floats
    force: Floats
    stiffness: Floats
    bones: tuple[int, ...]


def surroundings_of(
    fibres: Floats,
    start_bones: Ints,
    end_bones: Ints,
    bones: Mapping[int, Bone],
    muscle: TriangleTree,
    thickness: float,
) -> Surroundings:
    """Return the forces that hold fibres in their rest positions.

    A chain of springs needs the force 2 x_i - x_{i-1} - x_{i+1} at each point to stay on a course x that is
    not straight. At rest that force is there, so what bears it can be told:

    * a bone, as far as it pushes along its normal and the muscle lies on it: it lets go as soon as the path
      leaves it. Where there is a gap below a thickness between muscle and bone, it bears the less;
    * the muscle's own pressure, where fibres beside each other bow apart. It does not change;
    * tissue round the muscle, where all of a bundle bows and no bone is near: a hamstring lies on other
      muscles and under a fascia. It is an elastic foundation (Winkler) at right angles to the fibre, whose
      force changes by what it is at rest as the path goes aside by a thickness.

    A path that a bone pushes with the force p, where that bone turns away to its side with the curvature k,
    is in unstable equilibrium: the force aside grows by k p. At rest the path stays where it is, so the
    tissue beside it is at least as stiff as that: it holds the path with k p.

    A path also shears the tissue between it and the bones that it comes from when it goes aside over them:
    a layer as thick as the distance d, of the stiffness m (L / d)^2, with m of :data:`MODULUS`. Each bone's
    part of that falls along the fibre, from all at its end to none at the other.

    Pressure and tissue go with the bones by how near these are; where no bones are given, with those of the
    ends, from all of one to all of the other along the fibre.

    Parameters
    ----------
    fibres : (f, n, 3) array
        At rest, evenly spread [mm].
    start_bones, end_bones : (f,) int arrays
        The bones of the ends.
    bones : mapping of int to Bone
        At rest, by their number.
    muscle : TriangleTree
        Its surface at rest.
    thickness : float
        2 V / A of the muscle [mm].
    """
    f, n, _ = fibres.shape
    shape = (len(bones), f, n)
    standoff, aside = np.zeros(shape), np.zeros((*shape, 3, 3))
    distances = np.zeros(shape)
    rest = np.zeros_like(fibres)
    rest[:, 1:-1] = 2.0 * fibres[:, 1:-1] - fibres[:, :-2] - fibres[:, 2:]
    tangents = directions_along(fibres)
    lengths = np.linalg.norm(np.diff(fibres, axis=1), axis=2).sum(axis=1)[:, None]
    along = np.linspace(0.0, 1.0, n)[None]
    for bone, (number, shape_of_bone) in enumerate(bones.items()):
        distance, outward, tissue = tissue_between(fibres, tangents, shape_of_bone, muscle)
        standoff[bone] = np.minimum(smoothed_along(tissue, THICKNESS_SMOOTHING), distance)
        distances[bone] = distance
        gap = np.clip((distance - standoff[bone]) / thickness, 0.0, 1.0)
        pushes = (1.0 - gap**2) ** 2 * np.maximum(np.einsum("fni,fni->fn", rest, outward), 0.0)
        rest -= pushes[..., None] * outward
        side = smoothed_along(np.cross(tangents, outward), ASIDE_SMOOTHING)
        across = np.linalg.norm(side, axis=2)
        side /= np.maximum(across, np.finfo(float).tiny)[..., None]
        part = (start_bones == number)[:, None] * (1.0 - along) + (end_bones == number)[:, None] * along
        layer = np.maximum(distance, LEAST_LAYER * thickness)
        held = MODULUS * (lengths / (layer * (n - 1))) ** 2 * part
        held = held * np.clip(2.0 * (across - LEAST_ACROSS), 0.0, 1.0)
        pushed = pushes > 0.0
        curvature = curvature_aside(shape_of_bone, fibres[pushed], side[pushed])
        held[pushed] += pushes[pushed] * np.maximum(curvature, 0.0)
        aside[bone] = held[..., None, None] * side[..., :, None] * side[..., None, :]
    if bones:
        held_by, shares = tuple(bones), shares_by_distance(distances)
    else:
        held_by = tuple(sorted({*start_bones.tolist(), *end_bones.tolist()}))
        numbers = np.array(held_by)[:, None]
        starts, ends = ((which == numbers)[..., None] for which in (start_bones, end_bones))
        shares = starts * (1.0 - along) + ends * along
        aside = np.zeros((*shares.shape, 3, 3))
    bow = bundle_of(fibres, BUNDLE * thickness).mean(rest.reshape(-1, 3)).reshape(rest.shape)
    across_fibre = np.eye(3) - tangents[..., :, None] * tangents[..., None, :]
    bed = (np.linalg.norm(bow, axis=2) / thickness)[..., None, None] * across_fibre
    return Surroundings(standoff, shares[..., None] * rest, aside + shares[..., None, None] * bed, held_by)


def curvature_aside(bone: Bone, points: Floats, side: Floats) -> Floats:
    """Return the curvature of a bone's level sets at points (k, 3) along unit directions, (k,) [1/mm].

    Positive where the bone is convex; by central differences of the normals over a cell of its field.
    """
    ahead, behind = (bone.field(points + way)[1] for way in (bone.cell * side, -bone.cell * side))
    curvature: Floats = np.einsum("ki,ki->k", ahead - behind, side) / (2.0 * bone.cell)
    return curvature


def shares_by_distance(distances: Floats) -> Floats:
    """Return shares (b, ...) that fall with the squares of distances (b, ...) [mm] and sum to 1.

    Shepard 1968, doi:10.1145/800186.810616.
    """
    least = np.finfo(float).eps * max(float(np.max(distances, initial=0.0)), 1.0)
    near = 1.0 / np.maximum(distances, least) ** 2
    shares: Floats = near / near.sum(axis=0)
    return shares
