"""The phantom hip: the demo's data set."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.hip_bones import HEAD_RADIUS, WING, femur, pelvis
from vtkmuscle.phantoms.implicit import Solid, spline_net, thick_sheet
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, phantom_from

#: Half thickness across a muscle, as a part of that in its middle.
ACROSS = (0.72, 0.95, 1.0, 0.95, 0.72)
#: Width over which the rims are rounded where a muscle is cut at a bone [mm].
CUT = 3.0
#: Left free between muscle and bone, for their triangles are flat where the solids are round [mm].
GAP = 0.2
#: Of flexion in each frame [degrees].
ANGLES = tuple(range(0, 91, 2))


@dataclass(frozen=True, eq=False)
class Sheet:
    """The middle sheet of a muscle.

    Knots are (k, 5, 3), rows from origin to insertion [mm]. ``half_thickness`` (k,) is the half thickness at
    the middle of each row [mm].
    """

    knots: Floats
    half_thickness: ArrayLike

    def beside(self, *bones: Solid) -> Solid:
        """Return the muscle, cut at the bones."""
        half = np.outer(np.asarray(self.half_thickness, dtype=np.float64), np.array(ACROSS))
        return beside_bones(thick_sheet(self.knots, half), *bones)

    def ring(self, along: tuple[float, float], across: tuple[float, float], count: int) -> Floats:
        """Return a rounded loop (count, 3) in the sheet's parameters [mm]."""
        angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        # A superellipse: nearly a rectangle, with round corners.
        u, v = (np.sign(wave) * np.abs(wave) ** 0.55 for wave in (np.sin(angles), np.cos(angles)))
        rows = along[0] + (along[1] - along[0]) * (u + 1.0) / 2.0
        columns = across[0] + (across[1] - across[0]) * (v + 1.0) / 2.0
        return self.points(rows, columns)

    def points(self, rows: Floats, columns: Floats) -> Floats:
        """Return points (n, 3) of the sheet at pairs of parameters in [0, 1] [mm]."""
        pairs = np.arange(len(rows))
        return spline_net(self.knots, rows, columns)[pairs, pairs]


def beside_bones(muscle: Solid, *bones: Solid) -> Solid:
    """Return a muscle, cut at bones."""
    for bone in bones:
        muscle = muscle.without(bone, CUT, gap=GAP)
    return muscle


def _wing(height: float, span: tuple[float, float]) -> Floats:
    """Return five points (5, 3) in the middle of the ilium's wing, at a height."""
    return spline_net(WING, np.linspace(*span, 5), [height])[:, 0]


def _on(bone: Solid, points: ArrayLike, offset: float, side: ArrayLike = (0, 0, 0)) -> Floats:
    """Return points on a side of a bone, lifted by an offset [mm]."""
    ground = bone.projected(np.asarray(points, dtype=np.float64) + 8.0 * np.asarray(side), steps=6)
    normals = bone.field(ground)[1]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return ground + offset * normals


def gluteus_medius(pelvis: Solid, femur: Solid) -> Sheet:
    """Return the gluteus medius, a fan from the outer ilium to the greater trochanter."""
    outer = (-0.9, 0.4, -0.2)
    trochanter = [(-76, 0, -13), (-79, 6, -15), (-80, 12, -16), (-79, 18, -14), (-74, 25, -10)]
    rows = [
        _on(pelvis, _wing(0.90, (0.08, 0.72)), 1.0, outer),
        _on(pelvis, _wing(0.64, (0.08, 0.72)), 4.5, outer),
        _on(pelvis, _wing(0.36, (0.12, 0.70)), 7.0, outer),
        [(-46, -22, 26), (-50, -8, 28), (-49, 6, 30), (-44, 21, 32), (-35, 35, 34)],
        [(-66, -5, 3), (-68, 3, 5), (-68, 11, 6), (-66, 19, 7), (-61, 28, 9)],
        _on(femur, trochanter, 1.0),
    ]
    return Sheet(np.array(rows), [5.0, 8.0, 10.0, 9.5, 7.5, 5.0])


def gluteus_maximus(pelvis: Solid, femur: Solid) -> Sheet:
    """Return the gluteus maximus, from ilium and sacrum to the gluteal tuberosity."""
    back = [(16, 95, 102), (37, 111, 82), (54, 106, 57), (65, 112, 29), (73, 111, 1)]
    tuberosity = [(-67, 25, -66), (-65, 26, -82), (-62, 26, -98), (-58, 25, -116), (-54, 23, -134)]
    rows = [
        _on(pelvis, back, 2.0),
        [(-16, 82, 76), (6, 99, 56), (26, 106, 34), (42, 108, 8), (55, 102, -20)],
        [(-50, 60, 28), (-30, 79, 16), (-8, 87, -2), (12, 86, -24), (30, 77, -50)],
        [(-78, 34, -26), (-64, 53, -32), (-46, 62, -44), (-28, 60, -62), (-12, 51, -80)],
        _on(femur, tuberosity, 2.0),
    ]
    return Sheet(np.array(rows), [6.5, 12.0, 14.5, 11.5, 6.0])


def iliacus(pelvis: Solid, femur: Solid) -> Sheet:
    """Return the iliacus, from the iliac fossa over the brim to the lesser trochanter."""
    inner = (0.9, -0.4, 0.2)
    trochanter = [(-29, 6, -66), (-26, 10, -66), (-24, 14, -66), (-22, 18, -66), (-21, 22, -66)]
    rows = [
        _on(pelvis, _wing(0.88, (0.10, 0.66)), 1.0, inner),
        _on(pelvis, _wing(0.62, (0.10, 0.68)), 3.5, inner),
        _on(pelvis, _wing(0.34, (0.06, 0.56)), 6.0, inner),
        [(-3, -45, 20), (3, -44, 20), (8, -43, 20), (13, -41, 21), (18, -39, 22)],
        [(-15, -44, -14), (-10, -45, -13), (-5, -45, -13), (0, -44, -12), (6, -41, -12)],
        [(-22, -24, -43), (-18, -25, -43), (-14, -25, -43), (-10, -24, -43), (-6, -22, -43)],
        _on(femur, trochanter, 1.5),
    ]
    return Sheet(np.array(rows), [5.0, 6.5, 8.5, 9.0, 9.0, 7.5, 5.5])


def hip(*, angles: ArrayLike = ANGLES, head_radius: float = HEAD_RADIUS, detail: float = 1.0) -> Phantom:
    """Return a right hip with three muscles.

    The hip has pelvis and femur, three muscles of different shape, and flexion of 0 to 90 degrees. The frame
    is the subject's: +x left, +y posterior, +z up, in mm; the centre of the femoral head is the origin. The
    femur turns about the x axis, forward and up. ``gluteus_medius`` is a fan from the outer ilium to the
    greater trochanter; ``gluteus_maximus`` is broad and thick, from the back of ilium and sacrum to the
    gluteal tuberosity, with an open landmark curve as insertion; ``iliacus`` bends over the pelvic brim in
    front of the joint to the lesser trochanter.

    Parameters
    ----------
    angles : (k,) array_like, optional
        Of flexion in each frame [degrees], ascending; every second degree by default.
    head_radius : float, optional
        Of the femoral head [mm]; the socket goes with the head.
    detail : float, optional
        Number of triangles, as a part of the default.

    Returns
    -------
    Phantom
        About 14 000 triangles in the pelvis, 7000 in the femur, 3000 in each muscle. Known answers: at rest
        muscles touch the bones at their attachments, but lie no more than 0.5 mm deep in bones or in other
        muscles anywhere; the femoral head is a ball of radius ``known["head_radius"]`` [mm] about the origin,
        and stays at the origin.

    Examples
    --------
    >>> from vtkmuscle.phantoms import hip
    >>> sorted(hip().muscles)
    ['gluteus_maximus', 'gluteus_medius', 'iliacus']
    >>> hip(head_radius=25.0, detail=0.3).known
    {'head_radius': 25.0}
    """
    bones, muscles, areas = hip_parts(head_radius, detail)
    return phantom_from(
        "hip",
        bones=bones,
        muscles=muscles,
        areas=areas,
        motion=hinge("femur", centre=(0, 0, 0), axis=(-1, 0, 0), angles=angles),
        known={"head_radius": head_radius},
    )


@lru_cache(maxsize=2)
def hip_parts(
    head_radius: float, detail: float
) -> tuple[dict[str, Surface], dict[str, Surface], dict[str, list[AttachmentArea]]]:
    """Return bones, muscles and areas of :func:`hip`, by name."""
    pelvic, femoral = pelvis(head_radius), femur(head_radius)
    makers = gluteus_medius, gluteus_maximus, iliacus
    medius, maximus, iliac = (make(pelvic, femoral) for make in makers)
    medius_solid, maximus_solid, iliac_solid = (
        sheet.beside(pelvic, femoral) for sheet in (medius, maximus, iliac)
    )
    maximus_solid = maximus_solid.without(medius_solid, CUT, gap=1.0)
    bones = {
        "pelvis": mesh_of(pelvic, 4.0, round(14000 * detail)),
        "femur": mesh_of(femoral, 3.5, round(7000 * detail)),
    }
    muscles = {
        "gluteus_medius": mesh_of(medius_solid, 3.5, round(3000 * detail)),
        "gluteus_maximus": mesh_of(maximus_solid, 4.2, round(3000 * detail)),
        "iliacus": mesh_of(iliac_solid, 3.2, round(3000 * detail)),
    }

    def area(role: str, curve: Floats, *, closed: bool = True) -> AttachmentArea:
        bone, solid = ("pelvis", pelvic) if role == "origin" else ("femur", femoral)
        return AttachmentArea(role, bone, solid.projected(curve), closed=closed)

    line = maximus.points(np.full(9, 1.0), np.linspace(0.04, 0.96, 9))
    areas = {
        "gluteus_medius": [
            area("origin", medius.ring((0.02, 0.36), (0.05, 0.95), 24)),
            area("insertion", medius.ring((0.90, 1.0), (0.10, 0.90), 16)),
        ],
        "gluteus_maximus": [
            area("origin", maximus.ring((0.0, 0.09), (0.04, 0.96), 24)),
            area("insertion", line, closed=False),
        ],
        "iliacus": [
            area("origin", iliac.ring((0.02, 0.30), (0.05, 0.95), 24)),
            area("insertion", iliac.ring((0.95, 1.0), (0.0, 1.0), 12)),
        ],
    }
    return bones, muscles, areas
