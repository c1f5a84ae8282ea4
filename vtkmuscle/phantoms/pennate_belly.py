"""A belly like that of the gastrocnemius: oblique fibres between two aponeuroses, of lengths that differ."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms.implicit import Solid
from vtkmuscle.phantoms.meshing import box, mesh_of
from vtkmuscle.phantoms.phantom import Phantom, ends, one_muscle

#: Half axes of the proximal aponeurosis, along x and y, and thickness of the belly along z [mm]. Fibres are
#: nearly as long as those of a dissected medial gastrocnemius (51 mm; Ward et al. 2009,
#: doi:10.1007/s11999-008-0594-8).
HALF_LENGTH, HALF_WIDTH, THICKNESS = 75.0, 28.0, 15.0
#: How far along x a fibre of the middle goes [mm], and by how much more for each mm of its place along x.
ADVANCE, GAIN = 40.0, 0.12
#: Width over which the edges are round [mm]; the aponeuroses reach so far of the way to them.
RIM, REACH = 3.0, 0.92
#: Grid [mm] and number of triangles of the muscle.
GRID, TRIANGLES = 1.5, 4000
#: Thickness of the plates that stand for the bones, edges of their triangles, distance of landmarks [mm].
PLATE, SPACING, LANDMARKS = 6.0, 5.0, 6.0


def pennate_belly() -> Phantom:
    """Return a muscle between two flat aponeuroses, elliptic and parallel, shifted against each other.

    The fibre from the place (x, y, 0) of the proximal aponeurosis goes straight to (x + 40 + 0.12 x, y, 15)
    on the distal one [mm]: of all maps that keep shares of the areas, this one has the least sum of squared
    distances. The areas of attachment are these aponeuroses. The plate ``distal_plate`` slides along x, away,
    by the pipeline's time in mm.

    Returns
    -------
    Phantom
        Known answers: ``known["fibre_length"](x)`` [mm] and ``known["pennation"](x)`` [degrees], against both
        aponeuroses, of the fibre that begins at x, and ``known["volume"]`` [mm^3], of the belly with sharp
        edges.

    Examples
    --------
    >>> from vtkmuscle.phantoms import pennate_belly
    >>> known = pennate_belly().known
    >>> [round(known["fibre_length"](x), 1) for x in (-60.0, 0.0, 60.0)], round(known["pennation"](0.0), 1)
    ([36.1, 42.7, 49.5], 20.6)
    """
    stretch = 1.0 + GAIN
    shifts = np.arange(0.0, 11.0)
    table = np.tile(np.eye(4), (len(shifts), 1, 1))
    table[:, 0, 3] = shifts
    reach = np.array([HALF_LENGTH + RIM, HALF_WIDTH + RIM])
    up = np.array([ADVANCE, 0.0, THICKNESS])
    low, high = np.append(-reach, -PLATE), np.append(reach, 0.0)
    wide = np.array([stretch, 1.0, 1.0])
    turns = np.linspace(0.0, 2.0 * np.pi, int(2.0 * np.pi * HALF_LENGTH / LANDMARKS), endpoint=False)
    circle = np.column_stack([np.cos(turns), np.sin(turns), 0.0 * turns])
    ring = REACH * circle * [HALF_LENGTH, HALF_WIDTH, 0.0]
    return one_muscle(
        "pennate_belly",
        "belly",
        mesh_of(_belly(), GRID, TRIANGLES),
        ends("proximal_plate", ring, "distal_plate", wide * ring + up),
        bones={
            "proximal_plate": box(low, high, SPACING),
            "distal_plate": box(
                wide * low + up + [0.0, 0.0, PLATE], wide * high + up + [0.0, 0.0, PLATE], SPACING
            ),
        },
        motion=RigidMotion(shifts, {"distal_plate": table}),
        template="pennate",
        known={
            "volume": np.pi * HALF_LENGTH * HALF_WIDTH * THICKNESS * (1.0 + stretch) / 2.0,
            "fibre_length": lambda x: float(np.hypot(ADVANCE + GAIN * x, THICKNESS)),
            "pennation": lambda x: float(np.degrees(np.arctan2(THICKNESS, ADVANCE + GAIN * x))),
        },
    )


def _belly() -> Solid:
    """Return what the fibres from all places of the proximal aponeurosis fill."""

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
    whole = Solid(field, -size, far)
    up = np.array([0.0, 0.0, 1.0])
    return whole.beside((0.0, 0.0, 0.0), -up, RIM).beside(THICKNESS * up, up, RIM)
