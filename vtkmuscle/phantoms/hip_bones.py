"""The bones of the phantom hip, as implicit solids.

The bones are the right half of a pelvis, and a femur. Head centre at the origin; +x to the subject's left
(medial of the right hip), +y posterior, +z up [mm]. The proportions are an adult's: the superior anterior
iliac spine lies 34 mm lateral, 52 mm anterior and 72 mm proximal of the head centre (Bell et al. 1990,
doi:10.1016/0021-9290(90)90054-7), the neck makes 127 degrees with the shaft and is turned forward by 12
degrees.
"""

from __future__ import annotations

import numpy as np

from vtkmuscle.phantoms.implicit import Solid, ball, thick_curve, thick_sheet, union

#: Radii of the femoral head and of the acetabulum [mm]: cartilage fills the gap.
HEAD_RADIUS = 23.0
SOCKET_RADIUS = 25.5

#: The neck's points from head to shaft [mm], at an angle of 127 degrees to the shaft.
NECK = np.array([(-8.0, 1.0, -5.0), (-26.0, 5.0, -19.0), (-46.0, 9.0, -34.0)])

#: Where the acetabulum opens to, and the centre of its rim [mm].
OUTWARD = np.array([-0.80, -0.33, -0.50]) / np.linalg.norm([-0.80, -0.33, -0.50])
RIM = 7.0 * OUTWARD

#: The ilium's wing: columns from its front border to the back, rows from the pelvic brim up to the crest.
WING = np.array(
    [
        [(-8, -29, 24), (-20, -40, 42), (-29, -48, 58), (-35, -52, 74)],
        [(-2, -4, 28), (-26, -9, 56), (-46, -14, 82), (-56, -20, 104)],
        [(12, 28, 26), (-10, 33, 60), (-34, 32, 92), (-47, 26, 121)],
        [(28, 58, 36), (16, 66, 62), (2, 72, 90), (-8, 72, 115)],
        [(42, 84, 44), (42, 90, 54), (41, 96, 64), (39, 101, 76)],
    ],
    dtype=np.float64,
)
WING_HALF_THICKNESS = np.array(
    [
        [11.0, 6.0, 5.5, 6.5],
        [13.0, 6.0, 4.0, 7.0],
        [14.0, 6.0, 4.0, 7.0],
        [11.0, 7.0, 5.0, 6.5],
        [9.0, 9.0, 9.0, 9.0],
    ]
)


def pelvis(head_radius: float = HEAD_RADIUS) -> Solid:
    """Return the right hip bone and the sacrum, a solid for a radius of the femoral head [mm]."""
    socket_radius = SOCKET_RADIUS + (head_radius - HEAD_RADIUS)
    wing = thick_sheet(WING, WING_HALF_THICKNESS)
    cup = ball((3, 2, 3), 36.0 + (head_radius - HEAD_RADIUS)).beside(RIM, OUTWARD, 5.0)
    ischium = thick_curve([(20, 28, 2), (28, 36, -34), (26, 28, -78)], [19, 14, 15.5])
    lower_ramus = thick_curve([(26, 24, -84), (50, -14, -76), (80, -46, -44)], [11, 6.5, 8])
    upper_ramus = thick_curve([(12, -18, 16), (36, -42, 14), (62, -54, -4), (80, -52, -26)], [15, 9, 8, 10])
    body = thick_curve([(80, -52, -22), (80, -46, -46)], [10, 9])
    bone = union([wing, cup, ischium, upper_ramus, lower_ramus, body], 9.0)
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
    head = ball((0, 0, 0), head_radius)
    neck = thick_curve(NECK, [16, 14, 18])
    shaft = thick_curve(
        [(-50, 10, -34), (-47, 8, -72), (-42, 3, -130), (-36, 2, -190), (-30, 6, -260)],
        [19, 16, 14, 14, 14.5],
    )
    greater = thick_curve([(-57, 8, -36), (-62, 13, -18), (-57, 19, -3)], [17, 14.5, 11])
    lesser = ball((-30, 25, -62), 9.0)
    tuberosity = thick_curve([(-57, 17, -72), (-52, 15, -104), (-46, 11, -140)], [6, 6, 5])
    crest = thick_curve([(-54, 24, -8), (-44, 26, -32), (-33, 25, -58)], [8, 7, 7])
    return union([head, neck, shaft, greater, lesser, crest, tuberosity], 9.0)
