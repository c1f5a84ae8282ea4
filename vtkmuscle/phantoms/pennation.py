"""A block of oblique fibres: pennation angle and fibre length are known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.rigid import RigidMotion
from vtkmuscle.filters.attachments import AttachmentArea
from vtkmuscle.phantoms.meshing import box
from vtkmuscle.phantoms.phantom import Phantom, phantom_from

#: Width (x, between the aponeuroses), depth (y) and length (z) of the block [mm].
WIDTH, DEPTH, LENGTH = 20.0, 40.0, 120.0
#: Thickness of the plates that stand for the bones, edge length of the triangles [mm].
PLATE = 6.0
SPACING = 4.0


def pennate_block() -> Phantom:
    """Return a block between two plates, for the pennate template.

    The block is 20 x 40 x 120 mm. Its origin aponeurosis is the lower half of the face x = 0, its insertion
    aponeurosis the upper half of the face x = 20 mm; all fibres run straight from one to the other, parallel
    to each other. The plate ``insertion_plate`` slides down along z, by the pipeline's time in mm.

    Returns
    -------
    Phantom
        Known answers: ``known["fibre_length"]`` is sqrt(20^2 + 60^2) = 63.25 mm, ``known["pennation"]``
        atan(20 / 60) = 18.43 degrees, against both aponeuroses; ``known["volume"]`` 96 000 mm^3.

    Examples
    --------
    >>> from vtkmuscle.phantoms import pennate_block
    >>> known = pennate_block().known
    >>> round(known["fibre_length"], 2), round(known["pennation"], 2)
    (63.25, 18.43)
    """
    half = LENGTH / 2.0
    areas = [
        AttachmentArea("origin", "origin_plate", _face(0.0, 0.0, half), closed=True),
        AttachmentArea("insertion", "insertion_plate", _face(WIDTH, half, LENGTH), closed=True),
    ]
    shifts = np.arange(0.0, 11.0)
    table = np.tile(np.eye(4), (len(shifts), 1, 1))
    table[:, 2, 3] = -shifts
    return phantom_from(
        "pennate_block",
        bones={
            "origin_plate": box((-PLATE, 0.0, 0.0), (0.0, DEPTH, half), SPACING),
            "insertion_plate": box((WIDTH, 0.0, half), (WIDTH + PLATE, DEPTH, LENGTH), SPACING),
        },
        muscles={"block": box((0.0, 0.0, 0.0), (WIDTH, DEPTH, LENGTH), SPACING)},
        areas={"block": areas},
        motion=RigidMotion(shifts, {"insertion_plate": table}),
        templates={"block": "pennate"},
        known={
            "fibre_length": float(np.hypot(WIDTH, half)),
            "pennation": float(np.degrees(np.arctan2(WIDTH, half))),
            "volume": WIDTH * DEPTH * LENGTH,
        },
    )


def _face(x: float, low: float, high: float) -> NDArray[np.float64]:
    """Return the boundary of an aponeurosis, a landmark every 10 mm."""
    y, z = np.arange(0.0, DEPTH, 10.0), np.arange(low, high, 10.0)
    sides = [
        np.column_stack([y, np.full(len(y), low)]),
        np.column_stack([np.full(len(z), DEPTH), z]),
        np.column_stack([DEPTH - y, np.full(len(y), high)]),
        np.column_stack([np.zeros(len(z)), high + low - z]),
    ]
    boundary = np.vstack(sides)
    return np.column_stack([np.full(len(boundary), x), boundary])
