"""Muscles whose fibres are known: straight blocks."""

from collections.abc import Mapping

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.meshing import box
from vtkmuscle.phantoms.phantom import Answer, Phantom, Surface, phantom_from

#: Width (x, between the aponeuroses), depth (y) and length (z) of the block [mm].
WIDTH, DEPTH, LENGTH = 20.0, 40.0, 120.0
#: Thickness of the plates that stand for bones, and edge length of triangles of plates and blocks [mm].
PLATE, SPACING = 6.0, 4.0


def sliding(bone: str, direction: tuple[int, int, int]) -> RigidMotion:
    """Return the motion of a plate along a direction by 0 to 10 mm, which are the times."""
    shifts = np.arange(0.0, 11.0)
    table = np.tile(np.eye(4), (len(shifts), 1, 1))
    table[:, :3, 3] = np.outer(shifts, direction)
    return RigidMotion(shifts, {bone: table})


def fibre_block(kind: str) -> Phantom:
    """Return a block with straight, parallel fibres.

    The block measures 20 x 40 x 120 mm. ``"parallel"``: fibres run from the whole bottom to the whole top.
    ``"pennate"``: fibres run from the lower half of the face x = 0 to the upper half of the face x = 20 mm.
    The plate ``insertion_plate`` slides down along z, by the pipeline's time in mm. Known answers are
    ``known["volume"]``, 96 000 mm^3; ``known["fibre_length"]`` [mm] and ``known["pennation"]`` [degrees],
    against the areas at the fibres' ends. ValueError if there is no such kind.

    Examples
    --------
    >>> from vtkmuscle.phantoms import fibre_block
    >>> known = fibre_block("parallel").known
    >>> known["fibre_length"], known["pennation"]
    (120.0, 90.0)
    """
    half = LENGTH / 2.0
    if kind == "parallel":
        answers = {"fibre_length": LENGTH, "pennation": 90.0}
        return block(kind, {"origin_plate": level(0.0)}, level(LENGTH), plates_at_ends(), answers)
    if kind != "pennate":
        raise InputError("fibre_block", f"kind is {kind!r}, but must be one of 'parallel', 'pennate'")
    bones = {"origin_plate": box((-PLATE, 0.0, 0.0), (0.0, DEPTH, half), SPACING)}
    bones["insertion_plate"] = box((WIDTH, 0.0, half), (WIDTH + PLATE, DEPTH, LENGTH), SPACING)
    origins = {"origin_plate": wall(0.0, 0.0, half)}
    return block(kind, origins, wall(WIDTH, half, LENGTH), bones, straight(WIDTH))


def pennate_block() -> Phantom:
    """Return :func:`fibre_block` of the pennate kind.

    The fibres are sqrt(20^2 + 60^2) = 63.25 mm long, at a pennation of atan(20 / 60) = 18.43 degrees.
    """
    return fibre_block("pennate")


def block(
    kind: str, origins: Mapping[str, Floats], insertion: Floats, bones: Mapping[str, Surface],
    answers: Mapping[str, Answer], superficial: Mapping[str, vtkPolyData] | None = None,
) -> Phantom:  # fmt: skip
    """Return the block between plates; areas have corners (4, 3)."""
    rings = [AttachmentArea("origin", bone, _ring(corners), closed=True) for bone, corners in origins.items()]
    rings.append(AttachmentArea("insertion", "insertion_plate", _ring(insertion), closed=True))
    answers = {"volume": WIDTH * DEPTH * LENGTH, **answers}
    muscles, areas = {"block": box((0.0, 0.0, 0.0), (WIDTH, DEPTH, LENGTH), SPACING)}, {"block": rings}
    scene = f"{kind}_block", bones, muscles, areas, sliding("insertion_plate", (0, 0, -1)), answers
    return phantom_from(*scene, template=kind, superficial=superficial)


def plates_at_ends() -> dict[str, Surface]:
    """Return the plates below and above the block."""
    heights = {"origin_plate": -PLATE, "insertion_plate": LENGTH}
    return {name: box((0.0, 0.0, z), (WIDTH, DEPTH, z + PLATE), SPACING) for name, z in heights.items()}


def straight(width: float) -> dict[str, float]:
    """Return the answers for fibres over a width, which rise by half the length."""
    rise = LENGTH / 2.0
    pennation = float(np.degrees(np.arctan2(width, rise)))
    return {"fibre_length": float(np.hypot(width, rise)), "pennation": pennation}


def level(z: float) -> Floats:
    """Return the corners (4, 3) of the block's section at a height [mm]."""
    return np.array([(0.0, 0.0, z), (WIDTH, 0.0, z), (WIDTH, DEPTH, z), (0.0, DEPTH, z)])


def wall(x: float, low: float, high: float) -> Floats:
    """Return the corners (4, 3) of a part of the plane across x [mm]."""
    return np.array([(x, 0.0, low), (x, DEPTH, low), (x, DEPTH, high), (x, 0.0, high)])


def _ring(corners: Floats, apart: float = 10.0) -> Floats:
    """Return landmarks (k, 3) around an area with corners (4, 3), at most some way apart [mm]."""
    sides = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = int(np.ceil(np.linalg.norm(b - a) / apart - 1e-9))
        sides.append(a + np.arange(count)[:, None] / count * (b - a))
    return np.vstack(sides)
