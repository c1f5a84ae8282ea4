"""Blocks whose fibres run as those of a template do: their lengths and pennation angles are known."""

from collections.abc import Callable

import numpy as np
from scipy.integrate import quad
from scipy.interpolate import BPoly
from shapes import lines_of
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.types import Floats
from vtkmuscle.data.attachments import Aponeurosis
from vtkmuscle.phantoms import fibre_bodies
from vtkmuscle.phantoms.fibre_bodies import (
    DEPTH,
    LENGTH,
    PLATE,
    SPACING,
    WIDTH,
    block,
    level,
    plates_at_ends,
    straight,
    wall,
)
from vtkmuscle.phantoms.meshing import box
from vtkmuscle.phantoms.phantom import Phantom

#: From a coordinate's control points, as functions of r or s, to the kind's fibres.
Controls = tuple[Callable[[float], float], ...]

#: Where superficial fibres of the curved block are, by x at both ends, and their points.
SEEN_R, SEEN_POINTS = (0.1, 0.35, 0.6), 13

#: Coordinates of the control points of curved and fanned fibres, as parts of the block's sides.
_COURSES: dict[str, tuple[Controls, Controls]] = {
    "curved": (
        (lambda r: r, lambda r: 0.3 + 0.7 * r, lambda r: 0.6 + 0.4 * r, lambda r: 0.3 + 0.7 * r, lambda r: r),
        (lambda s: s,) * 5,
    ),
    "fan": (
        (lambda r: r, lambda r: 0.05 + 0.9 * r, lambda r: 0.3 + 0.4 * r, lambda r: 0.35 + 0.3 * r),
        (lambda s: s, lambda s: 0.05 + 0.9 * s, lambda s: 0.2 + 0.6 * s, lambda s: 0.25 + 0.5 * s),
    ),
}


def fibre_block(kind: str) -> Phantom:
    """Return a block of 20 x 40 x 120 mm for one kind of template.

    ``"parallel"``: fibres run straight from the whole bottom to the whole top. ``"pennate"``: straight and
    parallel from the lower half of the face x = 0 to the upper half of the face x = 20 mm. ``"bipennate"``:
    from the lower halves of both of these faces to a tendon in the middle of the upper half, within the
    muscle. ``"curved"``: in arcs that lean towards x = 20 mm; the block looks the same from four sides, so
    superficial fibres on the face y = 0 show this one. ``"fan"``: from the whole bottom to a part in the
    middle of the top. The plate ``insertion_plate`` slides down along z, by the pipeline's time in mm.

    Known: ``volume``, 96 000 mm^3; for the kinds parallel, pennate and bipennate ``fibre_length`` [mm] and
    ``pennation`` [degrees], against the areas at the fibres' ends; for the others ``fibre_length(r, s)``,
    ``pennation_origin(r, s)`` and ``pennation_insertion(r, s)``, by integration of the Bezier curve's
    derivative.
    """
    if kind in ("parallel", "pennate"):
        return fibre_bodies.fibre_block(kind)
    bones = plates_at_ends()
    if kind == "bipennate":
        half = LENGTH / 2.0
        bones["origin_plate"] = box((-PLATE, 0.0, 0.0), (0.0, DEPTH, half), SPACING)
        right = box((WIDTH, 0.0, 0.0), (WIDTH + PLATE, DEPTH, half), SPACING)
        bones = {"origin_plate": bones["origin_plate"], "second_origin_plate": right} | bones
        origins = {"origin_plate": wall(0.0, 0.0, half), "second_origin_plate": wall(WIDTH, 0.0, half)}
        return block(kind, origins, wall(WIDTH / 2.0, half, LENGTH), bones, straight(WIDTH / 2.0))
    insertion = level(LENGTH)
    if kind == "fan":
        middle = np.array([WIDTH / 2.0, DEPTH / 2.0, LENGTH])
        insertion = middle + (insertion - middle) * [0.3, 0.5, 1.0]
    seen = {"block": _seen()} if kind == "curved" else None
    return block(kind, {"origin_plate": level(0.0)}, insertion, bones, _bent(*_COURSES[kind]), seen)


def block_sheets(kind: str) -> tuple[Aponeurosis, ...]:
    """Return the aponeuroses that the fibres of a pennate or bipennate block go between."""
    half, proximal = LENGTH / 2.0, (0.0,) if kind == "pennate" else (0.0, WIDTH)
    distal = Aponeurosis("distal", wall(WIDTH / len(proximal), half, LENGTH))
    return *(Aponeurosis("proximal", wall(x, 0.0, half)) for x in proximal), distal


def _bent(x: Controls, y: Controls) -> dict[str, Callable[..., float]]:
    """Return the answers for Bezier curves with evenly spaced heights and these other coordinates."""

    def velocity(r: float, s: float, t: float) -> Floats:
        return np.array([WIDTH * _slope(x, r, t), DEPTH * _slope(y, s, t), LENGTH])

    def pennation(r: float, s: float, t: float) -> float:
        way = velocity(r, s, t)
        return float(np.degrees(np.arcsin(way[2] / np.linalg.norm(way))))

    def length(r: float, s: float) -> float:
        return float(quad(lambda t: float(np.linalg.norm(velocity(r, s, t))), 0.0, 1.0)[0])

    return {
        "fibre_length": length,
        "pennation_origin": lambda r, s: pennation(r, s, 0.0),
        "pennation_insertion": lambda r, s: pennation(r, s, 1.0),
    }


def _slope(controls: Controls, parameter: float, t: float) -> float:
    return float(_bezier(controls, parameter).derivative()(t))


def _bezier(controls: Controls, parameter: float) -> BPoly:
    """Return the polynomial of t, from 0 to 1, with these control points."""
    return BPoly([[control(parameter)] for control in controls], [0.0, 1.0])


def _seen() -> vtkPolyData:
    """Return a few fibres of the curved block on its face y = 0, without their ends."""
    t = np.linspace(0.1, 0.9, SEEN_POINTS)
    x = [WIDTH * _bezier(_COURSES["curved"][0], r)(t) for r in SEEN_R]
    return lines_of([np.column_stack([row, np.zeros(len(t)), LENGTH * t]) for row in x])
