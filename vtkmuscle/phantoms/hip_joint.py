"""The phantom hip: the demo's data set."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.hip_bones import HEAD_RADIUS, NECK_ANGLE, WING, femur, neck_shift, pelvis
from vtkmuscle.phantoms.implicit import Solid, spline_net, thick_sheet
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, phantom_from

#: Half thickness across a muscle, as a part of that in its middle.
ACROSS = (0.72, 0.95, 1.0, 0.95, 0.72)


@dataclass(frozen=True, eq=False)
class Sheet:
    """The middle sheet of a muscle and its half thickness.

    Attributes
    ----------
    nodes : (k, l, 4) float array
        Position and half thickness; rows from origin to insertion [mm].
    """

    nodes: Floats

    @property
    def solid(self) -> Solid:
        """All that is within the half thickness of the sheet."""
        return thick_sheet(self.nodes[..., :3], self.nodes[..., 3])

    def ring(self, along: tuple[float, float], across: tuple[float, float], count: int) -> Floats:
        """Return a closed curve on the sheet, an ellipse-like loop in its parameters, (count, 3) [mm]."""
        angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        # A superellipse: nearly a rectangle, with round corners.
        u, v = (np.sign(wave) * np.abs(wave) ** 0.55 for wave in (np.sin(angles), np.cos(angles)))
        rows = along[0] + (along[1] - along[0]) * (u + 1.0) / 2.0
        columns = across[0] + (across[1] - across[0]) * (v + 1.0) / 2.0
        return self.points(rows, columns)

    def points(self, rows: ArrayLike, columns: ArrayLike) -> Floats:
        """Return points of the sheet at pairs of parameters in [0, 1], (n, 3) [mm]."""
        r, c = np.broadcast_arrays(np.asarray(rows, dtype=np.float64), np.asarray(columns, dtype=np.float64))
        net = spline_net(self.nodes[..., :3], r, c)
        return net[np.arange(len(r)), np.arange(len(r))]


@dataclass(frozen=True, eq=False)
class Build:
    """How a muscle differs from that of the phantom hip.

    Attributes
    ----------
    volume : float
        Its volume, as a part of that one's: it is so much thicker.
    shift : (3,) array
        Where the femur is moved to [mm]; what lies between the bones is drawn along.
    """

    volume: float = 1.0
    shift: ArrayLike = (0.0, 0.0, 0.0)

    def along(self, part: float, points: ArrayLike) -> Floats:
        """Return points of a part (0 at the pelvis, 1 at the femur) of the way, drawn along."""
        return np.array(points, dtype=np.float64) + part * np.asarray(self.shift)


_AS_IT_IS = Build()


def _sheet(rows: list[Floats], half_thickness: ArrayLike, volume: float) -> Sheet:
    knots = np.array(rows)
    half = volume * np.outer(np.asarray(half_thickness, dtype=np.float64), np.array(ACROSS))
    return Sheet(np.dstack([knots, half]))


def _wing(height: float, span: tuple[float, float]) -> Floats:
    """Return five points at a height of the ilium's wing, in its middle [mm]."""
    return spline_net(WING, np.linspace(*span, 5), [height])[:, 0]


def _on(bone: Solid, points: ArrayLike, offset: float, side: ArrayLike = (0, 0, 0)) -> Floats:
    """Return points on the surface of a bone, on the side that is given, lifted by an offset [mm]."""
    ground = bone.projected(np.asarray(points, dtype=np.float64) + 8.0 * np.asarray(side), steps=6)
    normals = bone.field(ground)[1]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return ground + offset * normals


def gluteus_medius(pelvis: Solid, femur: Solid, build: Build = _AS_IT_IS) -> Sheet:
    """Return the fan from the outer face of the ilium to the side of the greater trochanter."""
    outer = (-0.9, 0.4, -0.2)
    trochanter = [(-76, 0, -13), (-79, 6, -15), (-80, 12, -16), (-79, 18, -14), (-74, 25, -10)]
    return _sheet(
        [
            _on(pelvis, _wing(0.90, (0.08, 0.72)), 1.0, outer),
            _on(pelvis, _wing(0.64, (0.08, 0.72)), 4.5, outer),
            _on(pelvis, _wing(0.36, (0.12, 0.70)), 7.0, outer),
            build.along(0.5, [(-46, -22, 26), (-50, -8, 28), (-49, 6, 30), (-44, 21, 32), (-35, 35, 34)]),
            build.along(0.9, [(-66, -5, 3), (-68, 3, 5), (-68, 11, 6), (-66, 19, 7), (-61, 28, 9)]),
            _on(femur, build.along(1.0, trochanter), 1.0),
        ],
        [5.0, 8.0, 10.0, 9.5, 7.5, 5.0],
        build.volume,
    )


def gluteus_maximus(pelvis: Solid, femur: Solid, build: Build = _AS_IT_IS) -> Sheet:
    """Return the thick quadrilateral from the back of ilium and sacrum to the gluteal tuberosity."""
    back = [(16, 95, 102), (37, 111, 82), (54, 106, 57), (65, 112, 29), (73, 111, 1)]
    middle = [
        [(-16, 82, 76), (6, 99, 56), (26, 106, 34), (42, 108, 8), (55, 102, -20)],
        [(-50, 60, 28), (-30, 79, 16), (-8, 87, -2), (12, 86, -24), (30, 77, -50)],
        [(-78, 34, -26), (-64, 53, -32), (-46, 62, -44), (-28, 60, -62), (-12, 51, -80)],
    ]
    tuberosity = [(-67, 25, -66), (-65, 26, -82), (-62, 26, -98), (-58, 25, -116), (-54, 23, -134)]
    return _sheet(
        [
            _on(pelvis, back, 2.0),
            *(build.along(part, row) for part, row in zip((0.25, 0.5, 0.75), middle, strict=True)),
            _on(femur, build.along(1.0, tuberosity), 2.0),
        ],
        [6.5, 12.0, 14.5, 11.5, 6.0],
        build.volume,
    )


def iliacus(pelvis: Solid, femur: Solid, build: Build = _AS_IT_IS) -> Sheet:
    """Return the muscle from the iliac fossa over the pelvic brim to the lesser trochanter."""
    inner = (0.9, -0.4, 0.2)
    middle = [
        [(-3, -45, 20), (3, -44, 20), (8, -43, 20), (13, -41, 21), (18, -39, 22)],
        [(-15, -44, -14), (-10, -45, -13), (-5, -45, -13), (0, -44, -12), (6, -41, -12)],
        [(-22, -24, -43), (-18, -25, -43), (-14, -25, -43), (-10, -24, -43), (-6, -22, -43)],
    ]
    trochanter = [(-29, 6, -66), (-26, 10, -66), (-24, 14, -66), (-22, 18, -66), (-21, 22, -66)]
    return _sheet(
        [
            _on(pelvis, _wing(0.88, (0.10, 0.66)), 1.0, inner),
            _on(pelvis, _wing(0.62, (0.10, 0.68)), 3.5, inner),
            _on(pelvis, _wing(0.34, (0.06, 0.56)), 6.0, inner),
            *(build.along(part, row) for part, row in zip((0.0, 0.4, 0.8), middle, strict=True)),
            _on(femur, build.along(1.0, trochanter), 1.5),
        ],
        [5.0, 6.5, 8.5, 9.0, 9.0, 7.5, 5.5],
        build.volume,
    )


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
