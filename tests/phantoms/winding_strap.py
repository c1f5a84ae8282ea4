"""A strap that winds round a shaft, and slides along the shaft as its end turns about it."""

import numpy as np

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms import Phantom
from vtkmuscle.phantoms.meshing import box, solid_of_revolution
from vtkmuscle.phantoms.phantom import ends, phantom_from

#: Of the shaft and the strap's sections [mm], and the strap's height [mm] and turn [radians] at rest.
RADIUS, THICKNESS, WIDTH, HEIGHT, TURN = 20.0, 6.0, 16.0, 120.0, np.radians(120.0)


def winding_strap() -> Phantom:
    """Return a strap that lies on a shaft as a helix, whose lower end turns about the shaft's axis, z.

    Without friction it stays the shortest way, a helix of another pitch, and slides along the shaft by up to
    25 mm.
    ``known["moment_arm"](angle)`` [mm], of its middle at an angle [degrees].
    """
    middle = RADIUS + THICKNESS / 2.0

    def arm(angle: float) -> float:
        turn = TURN + np.radians(angle)
        return float(-(middle**2) * turn / np.hypot(middle * turn, HEIGHT))

    length = float(np.hypot(middle * TURN, HEIGHT))
    bones = {
        "shaft": _whole(_shaft(), _wound(*_block(-8.0, 0.0))),
        "arm": _wound(*_block(length, length + 8.0)),
    }
    muscle = _wound(*box((0.0, -WIDTH / 2.0, -THICKNESS / 2.0), (length, WIDTH / 2.0, THICKNESS / 2.0), 3.0))
    corners = np.array([(-1, -1), (0, -1), (1, -1), (1, 1), (0, 1), (-1, 1)]) * [0.5 * WIDTH, 0.5 * THICKNESS]
    first, last = (_wound(np.column_stack([np.full(6, at), corners]), None)[0] for at in (0.0, length))
    motion = hinge("arm", (0, 0, 0), (0, 0, 1), np.arange(-60.0, 91.0, 10.0))
    areas = {"strap": ends("shaft", first, "arm", last)}
    return phantom_from("winding_strap", bones, {"strap": muscle}, areas, motion, {"moment_arm": arm})


def _wound(places: Floats, triangles):
    """Return places along, across and out of the helix, in space; it goes straight on beyond its ends."""
    middle = RADIUS + THICKNESS / 2.0
    length = np.hypot(middle * TURN, HEIGHT)
    turn = TURN * np.clip(places[:, :1] / length, 0.0, 1.0)
    out = np.hstack([np.cos(turn), np.sin(turn), 0.0 * turn])
    along = (
        np.hstack([-np.sin(turn) * middle * TURN, np.cos(turn) * middle * TURN, 0.0 * turn - HEIGHT]) / length
    )
    start = middle * out + np.hstack([0.0 * turn, 0.0 * turn, HEIGHT * (0.5 - turn / TURN)])
    beyond = places[:, :1] - length * turn / TURN
    return start + beyond * along + places[:, 1:2] * np.cross(out, along) + places[:, 2:] * out, triangles


def _block(low: float, high: float):
    half, deep = WIDTH / 2.0 + 4.0, THICKNESS / 2.0
    return box((low, -half, -deep), (high, half, deep + 4.0), 4.0)


def _shaft():
    heights = np.linspace(-HEIGHT, HEIGHT, 33)
    return solid_of_revolution(heights, np.full(33, RADIUS), 96)


def _whole(one, other):
    return np.vstack([one[0], other[0]]), np.vstack([one[1], len(one[0]) + other[1]])
