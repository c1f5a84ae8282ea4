"""The muscles of the phantom hip: thick sheets from origin to insertion, cut where they meet the bones.

A muscle is a net of knots: rows from origin to insertion, columns across. Same frame as the bones [mm].
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms.hip_bones import WING
from vtkmuscle.phantoms.implicit import Solid, spline_net, thick_sheet

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
