"""Muscles whose fibres are known: straight blocks, and an oblique belly."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.implicit import Solid
from vtkmuscle.phantoms.meshing import box, mesh_of
from vtkmuscle.phantoms.phantom import Answer, Phantom, Surface, circle, ends, phantom_from

#: Width (x, between the aponeuroses), depth (y) and length (z) of the block [mm].
WIDTH, DEPTH, LENGTH = 20.0, 40.0, 120.0
#: Thickness of the plates that stand for bones, and edge length of triangles of plates and blocks [mm].
PLATE, SPACING = 6.0, 4.0
#: Largest distance of a block's landmarks [mm].
LANDMARKS = 10.0


def sliding(bone: str, direction: tuple[int, int, int]) -> RigidMotion:
    """Return the motion of a plate that goes 10 mm along a direction, its times the way in mm."""
    shifts = np.arange(0.0, 11.0)
    table = np.tile(np.eye(4), (len(shifts), 1, 1))
    table[:, :3, 3] = np.outer(shifts, direction)
    return RigidMotion(shifts, {bone: table})


def fibre_block(kind: str) -> Phantom:
    """Return a block of 20 x 40 x 120 mm whose fibres are straight and parallel.

    ``"parallel"``: from the whole bottom to the whole top. ``"pennate"``: from the lower half of the face
    x = 0 to the upper half of the face x = 20 mm. The plate ``insertion_plate`` slides down along z, by the
    pipeline's time in mm.

    Parameters
    ----------
    kind : str
        ``"parallel"`` or ``"pennate"``.

    Returns
    -------
    Phantom
        Known answers: ``known["volume"]``, 96 000 mm^3; ``known["fibre_length"]`` [mm] and
        ``known["pennation"]`` [degrees], against the areas on which fibres end.

    Raises
    ------
    ValueError
        If there is no such kind.

    Examples
    --------
    >>> from vtkmuscle.phantoms import fibre_block
    >>> known = fibre_block("parallel").known
    >>> known["fibre_length"], known["pennation"]
    (120.0, 90.0)
    """
    half = LENGTH / 2.0
    if kind == "parallel":
        known = {"fibre_length": LENGTH, "pennation": 90.0}
        return block(kind, {"origin_plate": level(0.0)}, level(LENGTH), plates_at_ends(), known)
    if kind != "pennate":
        raise InputError("fibre_block", f"kind is {kind!r}, but must be one of 'parallel', 'pennate'")
    bones = {
        "origin_plate": box((-PLATE, 0.0, 0.0), (0.0, DEPTH, half), SPACING),
        "insertion_plate": box((WIDTH, 0.0, half), (WIDTH + PLATE, DEPTH, LENGTH), SPACING),
    }
    return block(
        kind, {"origin_plate": wall(0.0, 0.0, half)}, wall(WIDTH, half, LENGTH), bones, straight(WIDTH)
    )


def pennate_block() -> Phantom:
    """Return :func:`fibre_block` of the pennate kind.

    Its fibres are sqrt(20^2 + 60^2) = 63.25 mm long, their pennation is atan(20 / 60) = 18.43 degrees.
    """
    return fibre_block("pennate")


def block(
    kind: str,
    origins: Mapping[str, Floats],
    insertion: Floats,
    bones: Mapping[str, Surface],
    known: Mapping[str, Answer],
    superficial: Mapping[str, vtkPolyData] | None = None,
) -> Phantom:
    """Return the block between plates: the corners (4, 3) of its origins, by bone, and of its insertion."""
    areas = [AttachmentArea("origin", bone, _ring(corners), closed=True) for bone, corners in origins.items()]
    areas.append(AttachmentArea("insertion", "insertion_plate", _ring(insertion), closed=True))
    return phantom_from(
        f"{kind}_block",
        bones=bones,
        muscles={"block": box((0.0, 0.0, 0.0), (WIDTH, DEPTH, LENGTH), SPACING)},
        areas={"block": areas},
        motion=sliding("insertion_plate", (0, 0, -1)),
        template=kind,
        known={"volume": WIDTH * DEPTH * LENGTH, **known},
        superficial=superficial,
    )


def plates_at_ends() -> dict[str, Surface]:
    """Return the plates below and above the block."""
    return {
        "origin_plate": box((0.0, 0.0, -PLATE), (WIDTH, DEPTH, 0.0), SPACING),
        "insertion_plate": box((0.0, 0.0, LENGTH), (WIDTH, DEPTH, LENGTH + PLATE), SPACING),
    }


def straight(width: float) -> dict[str, float]:
    """Return the answers for fibres that run to a wall at this distance, half the length farther up."""
    rise = LENGTH / 2.0
    return {
        "fibre_length": float(np.hypot(width, rise)),
        "pennation": float(np.degrees(np.arctan2(width, rise))),
    }


def level(z: float) -> Floats:
    """Return the corners (4, 3) of the block's section at a height [mm]."""
    return np.array([(0.0, 0.0, z), (WIDTH, 0.0, z), (WIDTH, DEPTH, z), (0.0, DEPTH, z)])


def wall(x: float, low: float, high: float) -> Floats:
    """Return the corners (4, 3) of a part of a plane across x [mm]."""
    return np.array([(x, 0.0, low), (x, DEPTH, low), (x, DEPTH, high), (x, 0.0, high)])


def _ring(corners: Floats) -> Floats:
    """Return the boundary of an area with these corners (4, 3), landmark by landmark."""
    sides = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = int(np.ceil(np.linalg.norm(b - a) / LANDMARKS - 1e-9))
        sides.append(a + np.arange(count)[:, None] / count * (b - a))
    return np.vstack(sides)


#: Half axes of the belly's proximal aponeurosis, along x and y, and its thickness along z [mm]. Fibres are
#: nearly as long as those of a dissected medial gastrocnemius (51 mm; Ward et al. 2009,
#: doi:10.1007/s11999-008-0594-8).
HALF_LENGTH, HALF_WIDTH, THICKNESS = 75.0, 28.0, 15.0
#: How far along x a fibre of the middle goes [mm], and by how much more for each mm of its start along x.
ADVANCE, GAIN = 40.0, 0.12
#: Width over which the belly's edges are round [mm]; the aponeuroses reach so far of the way to them.
RIM, REACH = 3.0, 0.92


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
    """Return the solid that the fibres from the proximal aponeurosis fill."""

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
    return Solid(field, -size, far).beside((0.0, 0.0, 0.0), -up, RIM).beside(THICKNESS * up, up, RIM)
