"""What lies between fibres and bones at rest: how near fibres may come, and where they are held."""

from __future__ import annotations

import math

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.mesh.triangle_tree import TriangleTree
from vtkmuscle.core.types import Floats

#: A bone is ahead of a fibre, not beside it, where the sine between the fibre and the direction to the bone
#: is less than this. The thickness of the tissue there is that of the nearest points beside the bone.
BESIDE = 0.1

#: A point less deep in the muscle than this part of the fibres' extent is on its surface, as their ends are:
#: rounding does not decide what lies below it.
ON_SURFACE = 1e-6

#: Steps of the search for the muscle's surface.
_STEPS = 30


def directions_along(points: Floats) -> Floats:
    """Return the unit tangents (f, n, 3) of polylines (f, n, 3)."""
    tangents = np.gradient(points, axis=1)
    length = np.linalg.norm(tangents, axis=-1, keepdims=True)
    unit: Floats = np.divide(tangents, length, out=np.zeros_like(tangents), where=length > 0)
    return unit


def smoothed_along(values: Floats, deviation: float) -> Floats:
    """Return values (f, n, ...) smoothed along n, as by a Gaussian; those of both ends stay.

    deviation : float
        The Gaussian's standard deviation, as a part of the whole length: however many points there are.
    """
    variance = (deviation * (values.shape[1] - 1)) ** 2
    passes = math.ceil(2.0 * variance - 1e-9)
    result = values.copy()
    for _ in range(passes):
        bend = result[:, :-2] - 2.0 * result[:, 1:-1] + result[:, 2:]
        result[:, 1:-1] += 0.5 * variance / passes * bend
    return result


def tissue_between(
    points: Floats, tangents: Floats, bone: Bone, muscle: TriangleTree
) -> tuple[Floats, Floats, Floats]:
    """Return the distance and direction of a bone from fibres, and the thickness of muscle between them.

    A fibre lies against a bone with its side. So the tissue counts from the fibre's point at right angles to
    the fibre, towards the bone, as far as it is in the muscle: a muscle wound round a cylinder has the same
    thickness below its fibres along all of its length, also where it has not come to the cylinder yet.

    Parameters
    ----------
    points, tangents : (f, n, 3) arrays
        Points of the fibres at rest [mm], and the fibres' unit directions there.
    bone : Bone
        At rest.
    muscle : TriangleTree
        The muscle's surface at rest, closed, facing outward.

    Returns
    -------
    distance : (f, n) array
        From the bone [mm].
    outward : (f, n, 3) array
        Unit direction away from the bone.
    thickness : (f, n) array
        Of the tissue between them, at most the distance [mm].
    """
    shape = points.shape[:2]
    at, along = points.reshape(-1, 3), tangents.reshape(-1, 3)
    distance, outward = bone.exact(at)
    ahead = np.einsum("ij,ij->i", outward, along)
    beside = -(outward - ahead[:, None] * along)
    size = np.linalg.norm(beside, axis=1)
    sure = size >= BESIDE
    beside[sure] /= size[sure, None]
    way = np.zeros(len(at))
    depth = np.maximum(-muscle.signed(at)[0], 0.0)
    nearest, inside = depth.copy(), depth > ON_SURFACE * float(np.ptp(at, axis=0).max())
    going = np.flatnonzero(sure & inside)
    for _ in range(_STEPS):
        # No surface is nearer than the depth: go on by that much.
        way[going] += depth[going]
        going = going[way[going] < distance[going]]
        if not len(going):
            break
        depth[going] = -muscle.signed(at[going] + way[going, None] * beside[going])[0]
        going = going[depth[going] > 1e-4 * way[going]]
    thickness = np.where(sure, way, nearest).reshape(shape)
    for fibre, known in zip(thickness, (sure & inside).reshape(shape), strict=True):
        if known.any() and not known.all():
            fibre[~known] = np.interp(np.flatnonzero(~known), np.flatnonzero(known), fibre[known])
    distance = distance.reshape(shape)
    return distance, outward.reshape(*shape, 3), np.minimum(thickness, distance)
