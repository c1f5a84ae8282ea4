"""Phantoms in other sizes and of other kinds, which decide no constant and try what others decided."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any
from unittest.mock import patch

import how_right  # noqa: F401 -- finds the phantoms of the tests
import numpy as np
from lifting_cords import lifting_cords
from phantoms import pulleys
from phantoms.straps import block, end_ring, strap
from phantoms.winding_strap import winding_strap
from scipy.spatial import ConvexHull

from vtkmuscle.core.motion.rigid import hinge
from vtkmuscle.core.types import Floats
from vtkmuscle.phantoms import Phantom, one_hinge, spindle_over_hinge, wrapping_cylinder
from vtkmuscle.phantoms.implicit import ball
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.phantoms.phantom import ends, phantom_from

brim, lifting, ring, sliver, spindle, two_joints = (
    import_module(f"phantoms.{name}")
    for name in [
        "brim_flexor",
        "lifting_strap",
        "ring_tendon",
        "slivered_tendon",
        "ball_spindle",
        "two_joint_strap",
    ]
)
#: Arms of two joints with rollers of 14 and 26 mm under a strap of 12 mm.
ARMS = (20.0, 32.0)


@contextmanager
def sized(module: ModuleType, **constants: Any) -> Iterator[None]:
    """Change the sizes of a module's phantoms."""

    def forget() -> None:
        for value in [*vars(module).values(), *vars(one_hinge).values()]:
            getattr(value, "cache_clear", lambda: None)()

    with patch.multiple(module, **constants):
        forget()
        yield
    forget()


def held_out() -> Iterator[tuple[str, Phantom, str | None]]:
    """Yield name, phantom and, of two, the coordinate that changes; its sizes hold until the next."""
    for size, radius, thickness, width in (
        ("thick strap, small roller", 12.0, 14.0, 30.0),
        ("thin strap, large roller", 40.0, 4.0, 24.0),
        ("broad strap over a roller", 20.0, 8.0, 70.0),
    ):
        with sized(pulleys, RADIUS=radius, THICKNESS=thickness):
            yield size, pulleys._strap(size, above=120.0, width=width), None
    yield "rod over a roller", pulleys.cord_over_roller([8.0] * 3, 28.0), None
    radii = [5.0, 12.0, 13.0, 10.0, 5.0, *[3.0] * 4]
    yield "belly and tendon over a roller", pulleys.cord_over_roller(radii, 23.0), None
    with patch.object(pulleys, "rod", lambda _start, _end, radius: ball((0.0, 0.0, 0.0), radius)):
        yield "rod over a sphere", pulleys.cord_over_roller([4.0] * 3, 24.0), None
    yield "strap over two rollers", _over_two_rollers(), None
    yield "strap that winds round a shaft", winding_strap(), None
    yield "sheet turned in its plane", _sheet(), None
    for radius, thickness, wrap in ((12.0, 16.0, 30.0), (30.0, 6.0, 60.0)):
        with sized(lifting, RADIUS=radius, THICKNESS=thickness, LIFT_OFF=wrap):
            yield f"lifting strap of {thickness:g} mm", lifting.lifting_strap(), None
    for radius, groove, rod in ((9.0, 8.0, 4.0), (14.0, 3.0, 8.0)):
        with sized(brim, BRIM_RADIUS=radius, RADIUS=rod, RING=0.75 * rod):
            yield f"flexor of {rod:g} mm, groove of {groove:g}", brim.flexor_over_brim(groove=groove), None
    yield "spindle over a hinge", spindle_over_hinge(), None
    for belly in (9.0, 24.0):
        with sized(one_hinge, BELLY_RADIUS=belly):
            for coordinate in ("flexion", "abduction"):
                yield f"spindle of {belly:g} mm", spindle.spindle_over_ball(), coordinate
    for half, height in ((9.0, 30.0), (4.5, 15.0)):
        with sized(ring, HALF=half, RING=np.array([-32.0, height])):
            yield f"ring of {half:g} mm", ring.tendon_through_ring(), None
    joint = np.array([ARMS[1] - ARMS[0], -100.0])
    with sized(two_joints, RADII=(14.0, 26.0), THICKNESS=12.0, WIDTH=40.0, ARMS=ARMS, LOWER=joint):
        for coordinate in ("upper", "lower"):
            yield "two joints", two_joints.strap_over_two_joints(), coordinate
    with sized(pulleys, HINGE=np.array([-45.0, -20.0]), ROUND=14.0):
        yield "tendon under a band, far hinge", pulleys.tendon_under_band(), None
    with sized(sliver, EDGE=25.0, TENDON=5.0, MIDDLE=30.0, BELLY=20.0):
        yield "thick slivered tendon", sliver.slivered_tendon(), None
    for radius, thickness, angles in ((40.0, 6.0, (0, 81)), (12.0, 12.0, (-60, 1))):
        with sized(one_hinge, RADIUS=radius, THICKNESS=thickness):
            yield f"cylinder of {radius:g} mm", wrapping_cylinder(angles=range(*angles, 5)), None
    for name, phantom in lifting_cords():
        yield name, phantom, None


def _over_two_rollers(forward: float = 14.0, height: float = 90.0, above: float = 170.0) -> Phantom:
    """Return a strap over a second roller in front of the bone, then over that about the hinge."""
    width, thickness = 26.0, pulleys.THICKNESS
    radius, half = pulleys.RADIUS + thickness / 2.0, width / 2.0 + 6.0
    turns = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    circle = radius * np.column_stack([np.cos(turns), np.sin(turns)])
    start, end = np.array([6.0 - radius, above]), pulleys._line(50.0, radius)[-1]
    behind = [[60.0, above], [60.0, end[1]]]
    # Taut: the front of the hull of both rollers and both ends, from the start on.
    points = np.vstack([start, end, circle, circle + np.array([-forward, height]), behind])
    hull = ConvexHull(points).vertices.tolist()
    hull = hull[hull.index(0) :] + hull[: hull.index(0)]
    line: Floats = points[hull[: hull.index(1) + 1]]
    bones = pulleys._bones(above, half, line)
    second = pulleys.rod((-half, -forward, height), (half, -forward, height), pulleys.RADIUS)
    bones["proximal"] = bones["proximal"].joined(second, 2.0)
    areas = ends(
        "proximal",
        end_ring(line[0], line[1] - line[0], width, thickness),
        "distal",
        end_ring(line[-1], line[-1] - line[-2], width, thickness),
    )
    made = {name: mesh_of(bone, 2.5, 6000) for name, bone in bones.items()}
    muscle = mesh_of(strap(line, width, thickness), 2.0, 4000)
    return pulleys._phantom("over_two_rollers", made, muscle, areas, radius)


def _sheet(width: float = 60.0, thickness: float = 8.0) -> Phantom:
    """Return a straight sheet, whose lower end turns in its plane, about an axis 40 mm from its middle."""
    line, axis = np.array([(0.0, 80.0), (0.0, -60.0)]), np.array([40.0, 0.0, 0.0])
    half, back = width / 2.0 + 6.0, thickness / 2.0 + 6.0
    bones = {
        "proximal": mesh_of(block((-half, -back, 80.0), (half, back, 100.0)), 2.5, 3000),
        "distal": mesh_of(block((-half, -back, -80.0), (half, back, -60.0)), 2.5, 3000),
    }
    rings = (end_ring(end, line[1] - line[0], width, thickness) for end in line)
    upper, lower = (
        np.linspace(-width / 2.0, width / 2.0, 201)[:, None] * [1, 0, 0] + [0, 0, z] for z in line[:, 1]
    )

    def arm(angle: float) -> float:
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        moved = (lower - axis) @ np.array([(c, 0, -s), (0, 1, 0), (s, 0, c)])
        pull = (upper - axis) - moved
        return float((np.cross(moved, pull)[:, 1] / np.linalg.norm(pull, axis=1)).mean())

    moving = hinge("distal", centre=axis, axis=(0, 1, 0), angles=np.arange(-15.0, 16.0, 3.0))
    areas = ends("proximal", next(rings), "distal", next(rings))
    muscle = mesh_of(strap(line, width, thickness), 2.0, 4000)
    return phantom_from(
        "sheet",
        bones=bones,
        muscles={"sheet": muscle},
        areas={"sheet": areas},
        motion=moving,
        known={"moment_arm": arm},
    )
