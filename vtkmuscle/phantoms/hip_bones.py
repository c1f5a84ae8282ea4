"""The bones of the phantom hip, as implicit solids.

The bones are the right half of a pelvis, and a femur. Frame and sources are in ``hip.toml``.
"""

from __future__ import annotations

import tomllib
from importlib.resources import files
from typing import Any

import numpy as np

from vtkmuscle.phantoms.implicit import Solid, ball, thick_curve, thick_sheet, union

#: Radii of the femoral head and of the acetabulum [mm]: cartilage fills the gap.
HEAD_RADIUS = 23.0
SOCKET_RADIUS = 25.5

#: Where the acetabulum opens to, and the centre of its rim [mm].
OUTWARD = np.array([-0.80, -0.33, -0.50]) / np.linalg.norm([-0.80, -0.33, -0.50])
RIM = 7.0 * OUTWARD

#: Tables of hip.toml [mm].
SHAPES: dict[str, Any] = tomllib.loads((files("vtkmuscle.phantoms") / "hip.toml").read_text(encoding="utf-8"))
WING = np.array(SHAPES["wing"]["knots"], dtype=np.float64)


def _parts(bone: str) -> list[Solid]:
    """Return the balls and thick curves of a bone."""
    return [
        ball(*knots, *radii) if len(knots) == 1 else thick_curve(knots, radii)
        for knots, radii in SHAPES[bone]
    ]


def pelvis(head_radius: float = HEAD_RADIUS) -> Solid:
    """Return the right hip bone and the sacrum, a solid for a radius of the femoral head [mm]."""
    socket_radius = SOCKET_RADIUS + (head_radius - HEAD_RADIUS)
    wing = thick_sheet(WING, SHAPES["wing"]["half_thickness"])
    cup = ball((3, 2, 3), 36.0 + (head_radius - HEAD_RADIUS)).beside(RIM, OUTWARD, 5.0)
    bone = union([wing, cup, *_parts("pelvis")], 9.0)
    free = thick_curve(np.outer([0.0, 30.0], OUTWARD), [socket_radius, socket_radius + 2.0])
    return bone.without(free, 4.0).joined(sacrum(), 14.0)


def sacrum() -> Solid:
    """Return the sacrum: wide above, bent backward, narrow below."""
    middle = np.array([(86, 52, 92), (86, 82, 62), (86, 100, 22), (86, 98, -18), (86, 84, -40)])
    half_widths = np.array([46, 42, 30, 16, 8.0])
    side = np.array([(-1, 0.12, 0), (-0.5, 0, 0), (0, 0, 0), (0.5, 0, 0), (1, 0.12, 0)])
    knots = middle[:, None, :] + half_widths[:, None, None] * side[None]
    half_thickness = np.outer([15, 14, 10, 7, 6.5], [0.85, 1, 1, 1, 0.85])
    ala = thick_sheet(knots, half_thickness)
    first_body = thick_curve([(86, 66, 78), (86, 58, 98)], [21, 22]).beside((86, 56, 104), (0, -0.4, 1), 5.0)
    spines = thick_curve([(86, 86, 92), (86, 106, 62), (86, 114, 22), (86, 106, -14)], [7, 7, 6, 5])
    return union([ala, first_body, spines], 12.0)


def femur(head_radius: float = HEAD_RADIUS) -> Solid:
    """Return the upper femur, sawn off below; the head has a radius [mm]."""
    return upper_femur(head_radius).beside((0, 0, -240), (0, 0, -1), 3.0)


def upper_femur(head_radius: float = HEAD_RADIUS) -> Solid:
    """Return the upper femur, to be cut or joined below z = -235."""
    return union([ball((0, 0, 0), head_radius), *_parts("femur")], 9.0)
