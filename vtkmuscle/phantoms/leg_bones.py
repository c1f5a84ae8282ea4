"""The bones of the phantom leg below the hip, as implicit solids: a whole femur, a tibia and a foot.

Frame and pelvis are those of :mod:`vtkmuscle.phantoms.hip_bones` [mm].
"""

from __future__ import annotations

from vtkmuscle.phantoms.hip_bones import upper_femur
from vtkmuscle.phantoms.implicit import Solid, ball, rod, thick_curve, union

#: A point on the axis of each joint; all of them run across the leg.
KNEE, ANKLE = (-14.0, 8.0, -412.0), (-14.0, 12.0, -806.0)
#: Radii of the rollers that condyles and talus are.
CONDYLE, TALUS = 21.0, 12.0


def femur() -> Solid:
    """Return a femur that ends in a roller about the axis of the knee."""
    shaft = thick_curve([(-32, 5, -235), (-24, 2, -300), (-16, 4, -370), (-14, 8, -398)], [14.5, 14, 17, 19])
    x, y, z = KNEE
    condyles = rod((x - 27, y, z), (x + 27, y, z), CONDYLE, rim=4.0)
    return union([upper_femur(), shaft, condyles], 10.0)


def tibia() -> Solid:
    """Return a tibia, flat above and below, with the tuberosity in front."""
    x, _, top = KNEE
    shaft = thick_curve([(x, 10, -452), (x, 6, -500), (x, 4, -600), (x, 10, -785)], [28, 19, 14, 15])
    whole = union([shaft, ball((x, -14, -476), 9.0)], 8.0)
    plateau = whole.beside((0, 0, top - CONDYLE - 2.0), (0, 0, 1), 3.0)
    return plateau.beside((0, 0, ANKLE[2] + TALUS + 2.0), (0, 0, -1), 2.0)


def foot() -> Solid:
    """Return a foot: the talus, a roller about the axis of the ankle, the heel, and what is before them."""
    x, y, z = ANKLE
    talus = rod((x - 18, y, z), (x + 18, y, z), TALUS, rim=3.0)
    heel = thick_curve([(x, 14, -822), (x, 48, -836)], [13, 12])
    front = thick_curve([(x, 8, -826), (x, -50, -842), (x, -110, -852)], [13, 11, 8])
    return union([talus, heel, front], 8.0)
