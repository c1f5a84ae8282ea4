"""The phantom hip: the demo's data set. Shapes, frame and sources are in ``hip.toml``."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.types import Floats
from vtkmuscle.data import toml_table
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.implicit import Solid, ball, spline_net, thick_curve, thick_sheet, union
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import Phantom, Surface, phantom_from

#: Half thickness across a muscle, as a part of that in its middle.
ACROSS = (0.72, 0.95, 1.0, 0.95, 0.72)
#: Width over which the rims are rounded where a muscle is cut at a bone [mm].
CUT = 3.0
#: Left free between muscle and bone, for their triangles are flat where the solids are round [mm].
GAP = 0.2
#: Of flexion in each frame [degrees].
ANGLES = tuple(range(0, 91, 2))
#: Radii of the femoral head and of the acetabulum [mm]: cartilage fills the gap.
HEAD_RADIUS = 23.0
SOCKET_RADIUS = 25.5
#: Where the acetabulum opens to, and the centre of its rim [mm].
OUTWARD = np.array([-0.80, -0.33, -0.50]) / np.linalg.norm([-0.80, -0.33, -0.50])
RIM = 7.0 * OUTWARD
Interval = tuple[float, float]
#: Tables of hip.toml [mm].
SHAPES = toml_table("vtkmuscle.phantoms", "hip.toml")
WING = np.array(SHAPES["wing"]["knots"], dtype=np.float64)


def _parts(bone: str) -> list[Solid]:
    """Return the balls and thick curves of a bone."""
    return [ball(*at, *radii) if len(at) == 1 else thick_curve(at, radii) for at, radii in SHAPES[bone]]


def pelvis(head_radius: float = HEAD_RADIUS) -> Solid:
    """Return the right hip bone and the sacrum, a solid for a radius of the femoral head [mm]."""
    socket_radius = SOCKET_RADIUS + (head_radius - HEAD_RADIUS)
    wing = thick_sheet(WING, SHAPES["wing"]["half_thickness"])
    cup = ball((3, 2, 3), 36.0 + (head_radius - HEAD_RADIUS)).cut_by(RIM, OUTWARD, 5.0)
    bone = union([wing, cup, *_parts("pelvis")], 9.0)
    free = thick_curve(np.outer([0.0, 30.0], OUTWARD), [socket_radius, socket_radius + 2.0])
    return bone.without(free, 4.0).joined(sacrum(), 14.0)


def sacrum() -> Solid:
    """Return the sacrum: wide above, bent backward, narrow below."""
    shape = SHAPES["sacrum"]
    rows = np.array(shape["half_widths"])[:, None, None] * np.array(shape["side"])
    knots = np.array(shape["middle"])[:, None] + rows
    ala = thick_sheet(knots, np.outer(shape["half_thickness"], shape["across"]))
    first_body = thick_curve(*shape["first_body"]).cut_by((86, 56, 104), (0, -0.4, 1), 5.0)
    return union([ala, first_body, thick_curve(*shape["spines"])], 12.0)


def upper_femur(head_radius: float = HEAD_RADIUS) -> Solid:
    """Return the upper femur, to be cut or joined below z = -235."""
    return union([ball((0, 0, 0), head_radius), *_parts("femur")], 9.0)


def _outline(sheet: Floats, along: Interval, across: Interval, count: int, *, closed: bool = True) -> Floats:
    """Return a rounded loop or an open curve (count, 3) in a sheet's parameters."""
    if closed:  # a superellipse: nearly a rectangle, with round corners
        angles = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        u, v = (np.sign(wave) * np.abs(wave) ** 0.55 for wave in (np.sin(angles), np.cos(angles)))
        rows = along[0] + (along[1] - along[0]) * (u + 1.0) / 2.0
        columns = across[0] + (across[1] - across[0]) * (v + 1.0) / 2.0
    else:
        rows, columns = (np.linspace(low, high, count) for low, high in (along, across))
    pairs = np.arange(count)
    return spline_net(sheet, rows, columns)[pairs, pairs]


def beside_bones(muscle: Solid, *bones: Solid) -> Solid:
    """Return a muscle, cut at bones."""
    for bone in bones:
        muscle = muscle.without(bone, CUT, gap=GAP)
    return muscle


def _sheet(shape: Mapping[str, Any], bones: Mapping[str, Solid]) -> Floats:
    """Return the knots (k, 5, 3) of a muscle's middle sheet, rows from origin to insertion [mm]."""
    rows = []
    for row in shape["rows"]:
        points, side = row.get("points"), (0, 0, 0)
        if points is None:  # five points in the middle of the ilium's wing
            (low, high), side = row["span"], shape["side"]
            points = spline_net(WING, np.linspace(low, high, 5), [row["wing"]])[:, 0]
        if "on" in row:  # on a side of a bone, lifted
            bone = bones[row["on"]]
            ground = bone.projected(np.asarray(points, dtype=np.float64) + 8.0 * np.asarray(side), steps=6)
            normals = bone.field(ground)[1]
            points = ground + row["lift"] * (normals / np.linalg.norm(normals, axis=1, keepdims=True))
        rows.append(points)
    return np.array(rows, dtype=np.float64)


def hip(*, angles: ArrayLike = ANGLES, head_radius: float = HEAD_RADIUS, detail: float = 1.0) -> Phantom:
    """Return a right hip with three muscles.

    The hip has pelvis and femur, three muscles of different shape, and flexion of 0 to 90 degrees. The frame
    is the subject's: +x left, +y posterior, +z up, in mm; the centre of the femoral head is the origin. The
    femur turns about the x axis, forward and up. ``gluteus_medius`` is a fan from the outer ilium to the
    greater trochanter; ``gluteus_maximus`` is broad and thick, from the back of ilium and sacrum to the
    gluteal tuberosity, with an open landmark curve as insertion; ``iliacus`` bends over the pelvic brim in
    front of the joint to the lesser trochanter.

    Known answers: at rest muscles touch the bones at their attachments, but lie no more than 0.5 mm deep in
    bones or in other muscles anywhere; the femoral head is a ball of radius ``known["head_radius"]`` [mm]
    about the origin, and stays at the origin.

    Parameters
    ----------
    angles : (k,) array_like, optional
        Of flexion in each frame [degrees], ascending; every second degree by default.
    head_radius : float, optional
        Of the femoral head [mm]; the socket goes with the head.
    detail : float, optional
        Number of triangles, as a part of 14 000 in the pelvis, 7000 in the femur, 3000 in a muscle.

    Examples
    --------
    >>> from vtkmuscle.phantoms import hip
    >>> sorted(hip().muscles)
    ['gluteus_maximus', 'gluteus_medius', 'iliacus']
    >>> hip(head_radius=25.0, detail=0.3).known
    {'head_radius': 25.0}
    """
    bones, muscles, areas = hip_parts(head_radius, detail)
    motion, answers = hinge("femur", (0, 0, 0), (-1, 0, 0), angles), {"head_radius": head_radius}
    return phantom_from("hip", bones=bones, muscles=muscles, areas=areas, motion=motion, known=answers)


@lru_cache(maxsize=2)
def hip_parts(
    head_radius: float, detail: float
) -> tuple[dict[str, Surface], dict[str, Surface], dict[str, list[AttachmentArea]]]:
    """Return bones, muscles and areas of :func:`hip`, by name."""
    sawn_off = upper_femur(head_radius).cut_by((0, 0, -240), (0, 0, -1), 3.0)
    solids = {"pelvis": pelvis(head_radius), "femur": sawn_off}
    shapes = SHAPES["muscles"]
    sheets = {name: _sheet(shape, solids) for name, shape in shapes.items()}
    bellies = {}
    for name, sheet in sheets.items():
        half_thickness = np.outer(shapes[name]["half_thickness"], ACROSS)
        bellies[name] = beside_bones(thick_sheet(sheet, half_thickness), *solids.values())
    bellies["gluteus_maximus"] = bellies["gluteus_maximus"].without(bellies["gluteus_medius"], CUT, gap=1.0)
    sizes = ("pelvis", 4.0, 14000), ("femur", 3.5, 7000)
    bones = {name: mesh_of(solids[name], spacing, round(size * detail)) for name, spacing, size in sizes}
    count = round(3000 * detail)
    muscles = {name: mesh_of(belly, shapes[name]["spacing"], count) for name, belly in bellies.items()}

    def area(muscle: str, role: str, bone: str) -> AttachmentArea:
        outline = shapes[muscle][role]
        landmarks = solids[bone].projected(_outline(sheets[muscle], **outline))
        return AttachmentArea(role, bone, landmarks, closed=outline.get("closed", True))

    ends = ("origin", "pelvis"), ("insertion", "femur")
    return bones, muscles, {name: [area(name, *end) for end in ends] for name in sheets}
