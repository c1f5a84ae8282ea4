"""The phantom hip: the demo's data set."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.hip_bones import HEAD_RADIUS, NECK_ANGLE, femur, neck_shift, pelvis
from vtkmuscle.phantoms.hip_muscles import Build, Sheet, gluteus_maximus, gluteus_medius, iliacus
from vtkmuscle.phantoms.implicit import Solid
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, phantom_from

#: Width over which the rims are rounded where a muscle is cut at a bone [mm].
CUT = 3.0
#: Left free between muscle and bone, for their triangles are flat where the solids are round [mm].
GAP = 0.2
#: Of flexion in each frame [degrees].
ANGLES = tuple(range(0, 91, 2))


def hip(*, angles: ArrayLike = ANGLES) -> Phantom:
    """Return a right hip: pelvis and femur, three muscles of different shape, flexion of 0 to 90 degrees.

    The frame is that of a subject: +x left, +y posterior, +z up, in mm; the centre of the femoral head is
    the origin. The femur turns about the x axis, forward and up. ``gluteus_medius`` is a fan from the outer
    ilium to the greater trochanter; ``gluteus_maximus`` is broad and thick, from the back of ilium and
    sacrum to the gluteal tuberosity, its insertion an open landmark curve; ``iliacus`` bends over the
    pelvic brim in front of the joint to the lesser trochanter.

    Parameters
    ----------
    angles : (k,) array_like, optional
        Of flexion in each frame [degrees], ascending; every second one by default.

    Returns
    -------
    Phantom
        About 14 000 triangles in the pelvis, 7000 in the femur, 3000 in each muscle. Known answers: at rest
        muscles touch the bones at their attachments, but lie no more than 0.5 mm deep in them or in each
        other anywhere; the femoral head is a ball of radius ``known["head_radius"]`` [mm] about the origin,
        and stays there.

    Examples
    --------
    >>> from vtkmuscle.phantoms import hip
    >>> sorted(hip().muscles)
    ['gluteus_maximus', 'gluteus_medius', 'iliacus']
    """
    return varied_hip(HipShape(), angles=angles)


@dataclass(frozen=True)
class HipShape:
    """What a hip is like.

    Attributes
    ----------
    head_radius : float
        Of the femoral head [mm]; the socket goes with it.
    neck_angle : float
        Between neck and shaft of the femur [degrees]; the shaft is moved beside the head, which stays.
    muscle_volume : float
        Of the muscles, as a part of that of :func:`hip`, in which they are not yet cut at the bones.
    """

    head_radius: float = HEAD_RADIUS
    neck_angle: float = NECK_ANGLE
    muscle_volume: float = 1.0


def varied_hip(
    shape: HipShape,
    *,
    axis: ArrayLike = (-1, 0, 0),
    angles: ArrayLike = ANGLES,
    detail: float = 1.0,
) -> Phantom:
    """Return a hip of another shape than :func:`hip`, made like it.

    Parameters
    ----------
    shape : HipShape
        What it is like.
    axis : (3,) array_like, optional
        Of flexion, through the centre of the head.
    angles : (k,) array_like, optional
        Of flexion [degrees], ascending.
    detail : float, optional
        Number of triangles, as a part of that of :func:`hip`.

    Examples
    --------
    >>> from vtkmuscle.phantoms.hip_joint import HipShape, varied_hip
    >>> varied_hip(HipShape(head_radius=25.0), detail=0.3).known
    {'head_radius': 25.0}
    """
    bones, muscles, areas = hip_parts(shape, detail)
    return phantom_from(
        "hip",
        bones=bones,
        muscles=muscles,
        areas=areas,
        motion=hinge("femur", centre=(0, 0, 0), axis=axis, angles=angles),
        templates=dict.fromkeys(muscles, "parallel"),
        known={"head_radius": shape.head_radius},
    )


@lru_cache(maxsize=2)
def hip_parts(
    shape: HipShape, detail: float
) -> tuple[dict[str, Surface], dict[str, Surface], dict[str, list[AttachmentArea]]]:
    """Return bones, muscles, and the muscles' attachment areas, by name."""
    pelvic, femoral = pelvis(shape.head_radius), femur(shape.head_radius, shape.neck_angle)
    build = Build(shape.muscle_volume, neck_shift(shape.neck_angle))
    makers = gluteus_medius, gluteus_maximus, iliacus
    medius, maximus, iliac = (make(pelvic, femoral, build) for make in makers)
    medius_solid = _beside_bones(medius, pelvic, femoral)
    maximus_solid = _beside_bones(maximus, pelvic, femoral).without(medius_solid, CUT, gap=1.0)
    iliac_solid = _beside_bones(iliac, pelvic, femoral)
    bones = {
        "pelvis": mesh_of(pelvic, 4.0, round(14000 * detail)),
        "femur": mesh_of(femoral, 3.5, round(7000 * detail)),
    }
    muscles = {
        "gluteus_medius": mesh_of(medius_solid, 3.5, round(3000 * detail)),
        "gluteus_maximus": mesh_of(maximus_solid, 4.2, round(3000 * detail)),
        "iliacus": mesh_of(iliac_solid, 3.2, round(3000 * detail)),
    }
    line = maximus.points(np.full(9, 1.0), np.linspace(0.04, 0.96, 9))
    areas = {
        "gluteus_medius": [
            _ring("origin", "pelvis", pelvic, medius.ring((0.02, 0.36), (0.05, 0.95), 24)),
            _ring("insertion", "femur", femoral, medius.ring((0.90, 1.0), (0.10, 0.90), 16)),
        ],
        "gluteus_maximus": [
            _ring("origin", "pelvis", pelvic, maximus.ring((0.0, 0.09), (0.04, 0.96), 24)),
            AttachmentArea("insertion", "femur", femoral.projected(line), closed=False),
        ],
        "iliacus": [
            _ring("origin", "pelvis", pelvic, iliac.ring((0.02, 0.30), (0.05, 0.95), 24)),
            _ring("insertion", "femur", femoral, iliac.ring((0.95, 1.0), (0.0, 1.0), 12)),
        ],
    }
    return bones, muscles, areas


def _beside_bones(muscle: Sheet, *bones: Solid) -> Solid:
    solid = muscle.solid
    for bone in bones:
        solid = solid.without(bone, CUT, gap=GAP)
    return solid


def _ring(role: str, bone: str, solid: Solid, curve: ArrayLike) -> AttachmentArea:
    return AttachmentArea(role, bone, solid.projected(np.asarray(curve)), closed=True)
