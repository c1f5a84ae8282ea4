"""What else holds fibres where they are at rest: tissue around the muscle that the scene does not have."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.jit import kernel
from vtkmuscle.core.paths.bundles import Bundle
from vtkmuscle.core.taut.places import nearest_segment, part_of_segment, turn_back
from vtkmuscle.core.paths.tissue import smoothed_along
from vtkmuscle.core.types import Bools, Floats

#: The course that is held is smoothed along the fibre, for strings have corners on bones: standard deviation
#: as a part of the length.
_SMOOTHING = math.sqrt(2.0) / 32.0

#: Rounds in which fibres that are pulled taut elsewhere than those beside them lose weight.
_ROUNDS = 5

#: Fibres nearer to a bone than this, in thicknesses of the muscle, touch it: distances below are the same.
_TOUCHING = 1e-3


class Bedding(NamedTuple):
    """How the tissue around a muscle holds its fibres.

    Attributes
    ----------
    force : (b, f, n, 3) array
        With which it holds each point of a fibre at rest, by the bone that it moves with, in the units of a
        string's springs [mm].
    course : (f, n, 3) array
        Where the fibre has that force [mm].
    bedded : (b, f) bool array
        Where any force is not 0.
    give : float
        How far aside a fibre has to move for the tissue's force to grow by what it is at rest [mm].
    """

    force: Floats
    course: Floats
    bedded: Bools
    give: float


def no_bedding(bones: int, fibres: Floats) -> Bedding:
    """Return the bedding of fibres (f, n, 3) that nothing holds."""
    force = np.zeros((bones, *fibres.shape))
    return Bedding(force, fibres, np.zeros(force.shape[:2], dtype=np.bool_), 1.0)


def bedding_of(
    fibres: Floats, taut: Floats, distances: Floats, bundle: Bundle, half_thickness: float, width: float
) -> Bedding:
    """Return what has to hold a muscle's bundles of fibres off their shortest ways, as they are at rest.

    A hamstring lies on other muscles and under a fascia: at rest it bows, though it is under tension and no
    bone is near. A string of springs needs the force 2 x_i - x_{i-1} - x_{i+1} at each point to stay on such
    a course x. Tissue around the muscle has to have it, and is taken to be elastic, at right angles to the
    fibre (a Winkler foundation that has a load at rest). It moves with the bones, each bone's share falling
    with the square of the fibre's distance from it (Shepard 1968, doi:10.1145/800186.810616).

    The bow is that of a bundle: how its fibres lie apart is the muscle's own shape, as is a bow within its
    thickness. The force fades with the square of the bow below that.

    Parameters
    ----------
    fibres, taut : (f, n, 3) arrays
        At rest, as they are and pulled taut round the bones [mm].
    distances : (b, f, n) array
        Of the fibres from the bones [mm].
    bundle : Bundle
        Which fibres lie beside which.
    half_thickness, width : float
        Of the muscle [mm]; the width is the tissue's ``give``.
    """
    thickness = 2.0 * half_thickness
    course = smoothed_along(taut + _bow(fibres - taut, bundle, thickness), _SMOOTHING)
    force = np.zeros_like(course)
    force[:, 1:-1] = 2.0 * course[:, 1:-1] - course[:, :-2] - course[:, 2:]
    off = np.linalg.norm(course - taut, axis=2, keepdims=True)
    force *= np.clip(off / thickness, 0.0, 1.0) ** 2
    near = 1.0 / np.maximum(distances, _TOUCHING * thickness) ** 2
    forces = (near / near.sum(axis=0))[..., None] * force
    return Bedding(forces, course, np.asarray((forces != 0.0).any(axis=(2, 3))), width)


def _bow(off: Floats, bundle: Bundle, width: float) -> Floats:
    """Return how far bundles are off their shortest ways (f, n, 3), where each fibre is ``off`` its own.

    The mean over the fibres beside one; those that differ by more than a width count the less, since they
    were pulled taut on another side of some bone (as in Holland, Welsch 1977,
    doi:10.1080/03610927708827533).
    """
    own = off.reshape(-1, 3)
    beside, mean = own[bundle.beside], own
    for _ in range(_ROUNDS):
        differ2 = ((beside - mean[:, None]) ** 2).sum(axis=2)
        weights = bundle.parts / (1.0 + differ2 / width**2) ** 2
        mean = np.einsum("pk,pki->pi", weights / weights.sum(axis=1, keepdims=True), beside)
    return mean.reshape(off.shape)


@kernel
def bed(
    p: Floats,
    f: int,
    k: int,
    to_rest: Floats,
    bedding: Bedding,
    matrices: Floats,
    right: Floats,
    work: Floats,
) -> None:
    """Add what the tissue along the course of string f, ``p``, as it moves with bone k, does to it.

    The tissue at each point of the course has hold of the place of the string that is nearest to it, and acts
    across the string: along it there is only the string's own tension. The two points beside that place share
    the force.
    """
    at, force, along, rest = work
    course, forces = bedding.course[f], bedding.force[k, f]
    for j in range(1, len(course) - 1):
        size2 = 0.0
        for q in range(3):
            rest[q] = course[j, q] - to_rest[q, 3]
            size2 += forces[j, q] ** 2
        if size2 == 0.0:
            continue
        turn_back(to_rest, rest, at)
        turn_back(to_rest, forces[j], force)
        i = nearest_segment(p, at, j)
        part = part_of_segment(p[i], p[i + 1], at)
        stiffness, length2, ahead = np.sqrt(size2) / bedding.give, 0.0, 0.0
        before, after = max(i - 1, 0), min(i + 2, len(p) - 1)
        for q in range(3):
            place = (1.0 - part) * p[i, q] + part * p[i + 1, q]
            # Of the two segments at a point neither counts alone: which one is nearer rounding would say.
            along[q] = (1.0 - part) * (p[i + 1, q] - p[before, q]) + part * (p[after, q] - p[i, q])
            force[q] += stiffness * (at[q] - place)
            length2 += along[q] * along[q]
            ahead += along[q] * force[q]
        if length2 == 0.0:
            continue
        for q in range(3):
            force[q] -= ahead / length2 * along[q]
        for end in range(2):
            share = part if end == 1 else 1.0 - part
            matrix, spring = matrices[i + end], share * stiffness
            matrix[0] += spring
            matrix[3] += spring
            matrix[5] += spring
            for q in range(3):
                right[i + end, q] += share * force[q] + spring * p[i + end, q]
