"""A belly between two aponeuroses, with fibres by formula."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms.fibre_bodies import PLATE, sliding
from vtkmuscle.phantoms.implicit import Solid
from vtkmuscle.phantoms.meshing import box, mesh_of
from vtkmuscle.phantoms.phantom import Phantom, circle, ends, phantom_from

#: Half axes of the belly's proximal aponeurosis, along x and y, and its thickness along z [mm]. Fibres are
#: nearly as long as those of a dissected medial gastrocnemius (51 mm; Ward et al. 2009,
#: doi:10.1007/s11999-008-0594-8).
HALF_LENGTH, HALF_WIDTH, THICKNESS = 75.0, 28.0, 15.0
#: Extent of the middle fibre along x [mm], and the increase per mm of the fibre's start along x.
ADVANCE, GAIN = 40.0, 0.12
#: Width of the belly's rounded edge [mm], and extent of the aponeuroses as a fraction of the belly's.
RIM, REACH = 3.0, 0.92


def pennate_belly() -> Phantom:
    """Return a muscle between two flat aponeuroses, elliptic and parallel, shifted against each other.

    A fibre runs straight from (x, y, 0) on the proximal aponeurosis to (x + 40 + 0.12 x, y, 15) on the distal
    aponeurosis [mm]: of all maps between equal shares of the areas, the map with the least sum of squared
    distances. The aponeuroses are the attachment areas. The plate ``distal_plate`` slides away along x, by
    the pipeline's time in mm.

    Returns
    -------
    Phantom
        Known answers: ``known["fibre_length"](x)`` [mm] and ``known["pennation"](x)`` [degrees], against both
        aponeuroses, of the fibre from x, and ``known["volume"]`` [mm^3], of the belly with sharp
        edges.

    Examples
    --------
    >>> from belly import pennate_belly
    >>> known = pennate_belly().known
    >>> [round(known["fibre_length"](x), 1) for x in (-60.0, 0.0, 60.0)], round(known["pennation"](0.0), 1)
    ([36.1, 42.7, 49.5], 20.6)
    """
    wide = np.array([1.0 + GAIN, 1.0, 1.0])
    up = np.array([ADVANCE, 0.0, THICKNESS])
    high = np.array([HALF_LENGTH + RIM, HALF_WIDTH + RIM, 0.0])
    low = np.append(-high[:2], -PLATE)
    above = np.array([ADVANCE, 0.0, THICKNESS + PLATE])
    ring = circle(1.0, int(2.0 * np.pi * HALF_LENGTH / 6.0)) * [HALF_LENGTH, HALF_WIDTH, 0.0] * REACH
    return phantom_from(
        "pennate_belly",
        bones={
            "proximal_plate": box(low, high, 5.0),
            "distal_plate": box(wide * low + above, wide * high + above, 5.0),
        },
        muscles={"belly": mesh_of(_belly(), 1.5, 4000)},
        areas={"belly": ends("proximal_plate", ring, "distal_plate", wide * ring + up)},
        motion=sliding("distal_plate", (1, 0, 0)),
        template="pennate",
        known={
            "volume": np.pi * HALF_LENGTH * HALF_WIDTH * THICKNESS * (1.0 + GAIN / 2.0),
            "fibre_length": lambda x: float(np.hypot(ADVANCE + GAIN * x, THICKNESS)),
            "pennation": lambda x: float(np.degrees(np.arctan2(THICKNESS, ADVANCE + GAIN * x))),
        },
    )


def _belly() -> Solid:
    """Return the solid filled by fibres from the proximal aponeurosis."""

    def field(points: Floats) -> tuple[Floats, Floats]:
        t = points[:, 2] / THICKNESS
        widening = 1.0 + GAIN * t
        x, y = (points[:, 0] - ADVANCE * t) / widening / HALF_LENGTH, points[:, 1] / HALF_WIDTH
        radius = np.maximum(np.hypot(x, y), 1e-12)
        along_z = -(ADVANCE / HALF_LENGTH + GAIN * x) / (THICKNESS * widening)
        slope = np.column_stack([x / (widening * HALF_LENGTH), y / HALF_WIDTH, x * along_z]) / radius[:, None]
        return HALF_WIDTH * (radius - 1.0), HALF_WIDTH * slope

    size = np.array([HALF_LENGTH, HALF_WIDTH, 0.0])
    far = np.array([ADVANCE + (1.0 + GAIN) * HALF_LENGTH, HALF_WIDTH, THICKNESS])
    up = np.array([0.0, 0.0, 1.0])
    return Solid(field, -size, far).cut_by((0.0, 0.0, 0.0), -up, RIM).cut_by(THICKNESS * up, up, RIM)
