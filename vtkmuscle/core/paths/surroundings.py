"""Bones, tissue and pressure that hold a muscle's paths."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial.distance import cdist

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.mesh.surface import longest_side
from vtkmuscle.core.mesh.triangle_tree import TriangleTree
from vtkmuscle.core.paths.neighbours import path_lengths
from vtkmuscle.core.types import ROUNDING, SAME, Floats, Ints

#: The thickness of the tissue between a fibre and a bone is smoothed along the fibre by a Gaussian of this
#: standard deviation, as a part of its length. With half and twice of it mean moment arms of a hip change by
#: 0.9 and 1.9 mm at most.
THICKNESS_SMOOTHING = 1.0 / 32.0

#: A path keeps from a bone no more than this many thicknesses of the muscle: 2 V / A is a sheet's whole
#: thickness, and half of a rod's. More is muscle beside the path, which does not come between.
LARGEST_STANDOFF = 1.5

#: Width of the bundle whose bow tissue outside of the muscle holds, in thicknesses of the muscle. With half
#: and twice of it mean moment arms of a hip change by 1.1 mm at most.
BUNDLE = 2.0

#: Tissue beside a path on a bone is so many times as stiff as a ball with the path's bend is unstable. With 1
#: a fibre of an iliacus leaves its neighbours in time by 4.0 mm of moment arm, not 1.5; with 2 a rod of 20
#: segments slips off a ball in a pose; with 3.5 a fibre of a gluteus maximus leaves its neighbours by 2.4 mm,
#: not 1.8.
ASIDE = 2.5

#: A bone is ahead of a fibre, not beside it, where the sine between the fibre and the direction to the bone
#: is less than this. The thickness of the tissue there is that of the nearest points beside the bone. Without
#: the limit a supraspinatus does not settle in one of 21 poses.
LEAST_BESIDE = 0.1


class Surroundings(NamedTuple):
    """The forces that hold paths. By the bone that the forces move with.

    standoff : (p, f, n), least distance from each piece of a bone: the thickness of the tissue between [mm];
    force : (b, f, n, 3), force of each bone's tissue at rest, in the units of a path's springs [mm];
    stiffness : (b, f, n, 3, 3), fall of the force as the point leaves its place at rest, seen from the bone
        [1];
    bones : tuple of int, numbers of the bones with force and stiffness; without bones to keep away from, the
        bones of the ends.
    """

    standoff: Floats
    force: Floats
    stiffness: Floats
    bones: tuple[int, ...]


def surroundings_of(
    fibres: Floats, start_bones: Ints, end_bones: Ints, pieces: Sequence[tuple[int, Bone]],
    muscle: TriangleTree, thickness: float,
) -> Surroundings:  # fmt: skip
    """Return the forces that hold fibres at rest.

    Fibres (f, n, 3) are evenly spread. A chain of springs stays on a bent course x by the force
    2 x_i - x_{i-1} - x_{i+1} at each point. At rest the force is present, and is borne by:

    * a bone, as far as the bone pushes along the bone's normal and the muscle lies on the bone: the bone lets
      go as soon as the path leaves the bone. Where a gap below a thickness separates muscle and bone, the
      bone bears less;
    * the muscle's own pressure, where fibres beside each other bow apart. The pressure does not change;
    * tissue round the muscle, where all of a bundle bows and no bone is near: a hamstring lies on other
      muscles and under a fascia. The tissue is an elastic foundation (Winkler) at right angles to the fibre.

    When the path goes aside by a thickness, the force changes by what tissue bears at rest. Tissue beside a
    path holds the path on a bone. On a ball of a radius R the push p of the bone turns by x / R as the path
    goes aside by x, and takes the path away with a stiffness of p / R; with segments h long R is h^2 / p.

    Pressure and tissue go with the bones by nearness; where no bones are given, with the bones of the ends,
    from all of the first to all of the second along the fibre.

    fibres, start_bones, end_bones : as of :class:`~vtkmuscle.core.paths.sheet.MusclePaths`;
    pieces : sequence of (int, Bone), the bone that each piece belongs to, and the piece at rest;
    muscle : TriangleTree, the muscle's surface at rest;
    thickness : 2 V / A of the muscle [mm].
    """
    f, n, _ = fibres.shape
    bones = tuple(dict.fromkeys(number for number, _ in pieces))
    standoff, distances = np.zeros((len(pieces), f, n)), np.full((len(bones), f, n), np.inf)
    aside = np.zeros((len(bones), f, n, 3, 3))
    rest = -np.pad(np.diff(fibres, 2, axis=1), ((0, 0), (1, 1), (0, 0)))
    tangents, segments = directions_along(fibres), path_lengths(fibres)[:, None] / (n - 1)
    depth = muscle.depth(fibres.reshape(-1, 3)).reshape(f, n)
    for kept, (number, piece) in zip(standoff, pieces, strict=True):
        bone = bones.index(number)
        distance, outward, tissue = tissue_between(fibres, tangents, depth, piece, muscle)
        tissue = np.minimum(smoothed_along(tissue), distance)
        kept[:] = np.minimum(tissue, LARGEST_STANDOFF * thickness)
        np.minimum(distances[bone], distance, out=distances[bone])
        gap = np.clip((distance - kept) / thickness, 0.0, 1.0)
        pushes = (1.0 - gap**2) ** 2 * np.maximum(np.einsum("fni,fni->fn", rest, outward), 0.0)
        rest -= pushes[..., None] * outward
        aside[bone] += stiffness_aside(ASIDE * (pushes / segments) ** 2, np.cross(tangents, outward))
    shares = shares_by_distance(distances)
    if not bones:
        bones, along = tuple(sorted({*start_bones.tolist(), *end_bones.tolist()})), np.linspace(0.0, 1.0, n)
        starts, ends = ((which == np.array(bones)[:, None])[..., None] for which in (start_bones, end_bones))
        shares = starts * (1.0 - along) + ends * along
        aside = np.zeros((*shares.shape, 3, 3))
    bow = _bundle_means(rest, fibres, BUNDLE * thickness)
    bed = stiffness_of_bow(np.linalg.norm(bow, axis=2) / thickness, tangents)
    return Surroundings(standoff, shares[..., None] * rest, aside + shares[..., None, None] * bed, bones)


def stiffness_aside(size: Floats, side: Floats) -> Floats:
    """Return a stiffness of given size along the side (f, n, 3) of fibres, (f, n, 3, 3)."""
    unit = unit_vectors(side)
    return np.asarray(size[..., None, None] * unit[..., :, None] * unit[..., None, :])


def stiffness_of_bow(size: Floats, tangents: Floats) -> Floats:
    """Return a stiffness of given size in all directions across fibres."""
    return np.asarray(size[..., None, None] * (np.eye(3) - tangents[..., :, None] * tangents[..., None, :]))


def shares_by_distance(distances: Floats) -> Floats:
    """Return shares that fall with squares of distances.

    Shares of distances (b, ...) [mm] sum to 1 over b. Shepard 1968, doi:10.1145/800186.810616.
    """
    least = np.finfo(float).eps * max(float(np.max(distances, initial=0.0)), 1.0)
    near = 1.0 / np.maximum(distances, least) ** 2
    return np.asarray(near / near.sum(axis=0))


def _bundle_means(values: Floats, fibres: Floats, width: float) -> Floats:
    """Return means over neighbouring fibres. Of values (f, n, 3), within about a width [mm]."""
    means = np.empty_like(values)
    for i in range(fibres.shape[1]):
        section = fibres[:, i]
        weights = np.exp(-0.5 * (cdist(section, section) / width) ** 2)
        means[:, i] = weights @ values[:, i] / weights.sum(axis=1, keepdims=True)
    return means


def directions_along(points: Floats) -> Floats:
    """Return the unit tangents of polylines (f, n, 3)."""
    return unit_vectors(np.gradient(points, axis=1))


def smoothed_along(values: Floats) -> Floats:
    """Return values smoothed along n by a Gaussian.

    Values are (f, n, ...); the values of both ends stay. The Gaussian's standard deviation is a part of the
    whole length, whatever the number of points.
    """
    variance = (THICKNESS_SMOOTHING * (values.shape[1] - 1)) ** 2
    passes = math.ceil(2.0 * variance - ROUNDING)
    result = values.copy()
    for _ in range(passes):
        bend = result[:, :-2] - 2.0 * result[:, 1:-1] + result[:, 2:]
        result[:, 1:-1] += 0.5 * variance / passes * bend
    return result


def tissue_between(
    points: Floats, tangents: Floats, depth: Floats, bone: Bone, muscle: TriangleTree
) -> tuple[Floats, Floats, Floats]:
    """Return the tissue between fibres and a bone.

    A fibre lies against a bone with the fibre's side. So the tissue is measured from the fibre's point at
    right angles to the fibre, towards the bone, as far as the muscle reaches: a muscle wound round a cylinder
    has the same thickness below the fibres along the whole length, also ahead of the cylinder.

    points, tangents : (f, n, 3), points of the fibres at rest [mm], and unit tangents;
    depth : (f, n), of the points in the muscle, 0 outside [mm];
    bone : Bone, at rest;
    muscle : TriangleTree, the muscle's surface at rest, closed, facing outward.

    Returns distance : (f, n), from the bone [mm];
    outward : (f, n, 3), unit direction away from the bone;
    thickness : (f, n), of the tissue between fibre and bone, at most the distance [mm].
    """
    shape = points.shape[:2]
    at, along = points.reshape(-1, 3), tangents.reshape(-1, 3)
    distance, outward = bone.solids.exact(at)
    aside = np.einsum("ij,ij->i", outward, along)[:, None] * along - outward
    size = np.linalg.norm(aside, axis=1)
    sure = size >= LEAST_BESIDE
    aside[sure] /= size[sure, None]
    walked = np.zeros(len(at))
    nearest, depth = depth.reshape(-1), depth.reshape(-1).copy()
    inside = depth > SAME * longest_side(at)
    going = np.flatnonzero(sure & inside)
    while len(going):
        # No surface is nearer than the depth: go on by that much, and stay inside.
        walked[going] += depth[going]
        going = going[walked[going] < distance[going]]
        depth[going] = muscle.nearest(at[going] + walked[going, None] * aside[going])[2]
        going = going[depth[going] > 1e-4 * walked[going]]
    thickness = np.where(sure, walked, nearest).reshape(shape)
    for fibre, measured in zip(thickness, (sure & inside).reshape(shape), strict=True):
        if measured.any() and not measured.all():
            fibre[~measured] = np.interp(np.flatnonzero(~measured), np.flatnonzero(measured), fibre[measured])
    distance = distance.reshape(shape)
    return distance, outward.reshape(*shape, 3), np.minimum(thickness, distance)
