"""Blocks whose fibres run as those of a template do: their lengths and pennation angles are known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import Polylines, polylines_from
from vtkmuscle.data.attachments import AttachmentArea
from vtkmuscle.phantoms.meshing import box
from vtkmuscle.phantoms.phantom import Phantom, one_muscle

#: From a coordinate's control points, as functions of r or s, to the kind's fibres.
Controls = tuple[Callable[[float], float], ...]

#: Width (x, between the aponeuroses), depth (y) and length (z) of the block [mm].
WIDTH, DEPTH, LENGTH = 20.0, 40.0, 120.0
#: Thickness of the plates that stand for the bones, edge length of the triangles [mm].
PLATE = 6.0
SPACING = 4.0
#: A landmark at least so often [mm].
LANDMARKS = 10.0
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

    Parameters
    ----------
    kind : str
        One of :data:`vtkmuscle.core.template.kinds.KINDS`.

    Returns
    -------
    Phantom
        Known answers: ``known["volume"]``, 96 000 mm^3; for the kinds parallel, pennate and bipennate
        ``known["fibre_length"]`` [mm] and ``known["pennation"]`` [degrees], against the areas on which fibres
        end; for the others ``known["fibre_length"](r, s)``, ``known["pennation_origin"](r, s)`` and
        ``known["pennation_insertion"](r, s)`` of the fibre with these parameters, by integration of the
        Bezier curve's derivative.

    Raises
    ------
    ValueError
        If there is no such kind.

    Examples
    --------
    >>> from vtkmuscle.phantoms import fibre_block
    >>> known = fibre_block("bipennate").known
    >>> round(known["fibre_length"], 2), round(known["pennation"], 2)
    (60.83, 9.46)
    """
    half = LENGTH / 2.0
    bottom, top = _level(0.0), _level(LENGTH)
    below = box((0.0, 0.0, -PLATE), (WIDTH, DEPTH, 0.0), SPACING)
    above = box((0.0, 0.0, LENGTH), (WIDTH, DEPTH, LENGTH + PLATE), SPACING)
    left = box((-PLATE, 0.0, 0.0), (0.0, DEPTH, half), SPACING)
    right = box((WIDTH, 0.0, half), (WIDTH + PLATE, DEPTH, LENGTH), SPACING)
    lower_right = box((WIDTH, 0.0, 0.0), (WIDTH + PLATE, DEPTH, half), SPACING)
    known: dict[str, float | Callable[..., float]] = {"volume": WIDTH * DEPTH * LENGTH}
    superficial = None
    bones = {"origin_plate": below, "insertion_plate": above}
    origins, insertion = {"origin_plate": bottom}, top
    if kind == "parallel":
        known |= {"fibre_length": LENGTH, "pennation": 90.0}
    elif kind == "pennate":
        bones = {"origin_plate": left, "insertion_plate": right}
        origins, insertion = {"origin_plate": _wall(0.0, 0.0, half)}, _wall(WIDTH, half, LENGTH)
        known |= _straight(WIDTH)
    elif kind == "bipennate":
        bones = {"origin_plate": left, "second_origin_plate": lower_right, "insertion_plate": above}
        origins = {
            "origin_plate": _wall(0.0, 0.0, half),
            "second_origin_plate": _wall(WIDTH, 0.0, half),
        }
        insertion = _wall(WIDTH / 2.0, half, LENGTH)
        known |= _straight(WIDTH / 2.0)
    elif kind in _COURSES:
        known |= _bent(*_COURSES[kind])
        if kind == "fan":
            middle = np.array([WIDTH / 2.0, DEPTH / 2.0, LENGTH])
            insertion = middle + (top - middle) * [0.3, 0.5, 1.0]
        else:
            superficial = _seen()
    else:
        allowed = ", ".join(map(repr, ("parallel", "pennate", "bipennate", *_COURSES)))
        raise InputError("fibre_block", f"kind is {kind!r}, but must be one of {allowed}")
    shifts = np.arange(0.0, 11.0)
    table = np.tile(np.eye(4), (len(shifts), 1, 1))
    table[:, 2, 3] = -shifts
    areas = [AttachmentArea("origin", bone, _ring(corners), closed=True) for bone, corners in origins.items()]
    areas.append(AttachmentArea("insertion", "insertion_plate", _ring(insertion), closed=True))
    return one_muscle(
        f"{kind}_block",
        "block",
        box((0.0, 0.0, 0.0), (WIDTH, DEPTH, LENGTH), SPACING),
        areas,
        bones=bones,
        motion=RigidMotion(shifts, {"insertion_plate": table}),
        template=kind,
        known=known,
        superficial=superficial,
    )


def pennate_block() -> Phantom:
    """Return :func:`fibre_block` of the pennate kind.

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
    return fibre_block("pennate")


def _straight(width: float) -> dict[str, float]:
    """Return the answers for fibres that run to a wall at this distance, half the length farther up."""
    rise = LENGTH / 2.0
    return {
        "fibre_length": float(np.hypot(width, rise)),
        "pennation": float(np.degrees(np.arctan2(width, rise))),
    }


def _bent(x: Controls, y: Controls) -> dict[str, Callable[..., float]]:
    """Return the answers for Bezier curves with evenly spaced heights and these other coordinates."""

    def velocity(r: float, s: float, t: float) -> Floats:
        return np.array([WIDTH * _slope(x, r, t), DEPTH * _slope(y, s, t), LENGTH])

    def pennation(r: float, s: float, t: float) -> float:
        way = velocity(r, s, t)
        return float(np.degrees(np.arcsin(way[2] / np.linalg.norm(way))))

    def length(r: float, s: float) -> float:
        from scipy.integrate import quad  # noqa: PLC0415 -- a demo needs none

        return float(quad(lambda t: float(np.linalg.norm(velocity(r, s, t))), 0.0, 1.0)[0])

    return {
        "fibre_length": length,
        "pennation_origin": lambda r, s: pennation(r, s, 0.0),
        "pennation_insertion": lambda r, s: pennation(r, s, 1.0),
    }


def _slope(controls: Controls, parameter: float, t: float) -> float:
    """Return the derivative of a Bezier polynomial by t, by de Casteljau's rule."""
    values = np.array([control(parameter) for control in controls])
    steps = (len(values) - 1) * np.diff(values)
    while len(steps) > 1:
        steps = (1.0 - t) * steps[:-1] + t * steps[1:]
    return float(steps[0])


def _seen() -> vtkPolyData:
    """Return a few fibres of the curved block on its face y = 0, without their ends."""
    t = np.linspace(0.1, 0.9, SEEN_POINTS)
    lines = []
    for r in SEEN_R:
        values = np.array([control(r) for control in _COURSES["curved"][0]])
        row = np.tile(values[:, None], (1, len(t)))
        while len(row) > 1:
            row = (1.0 - t) * row[:-1] + t * row[1:]
        lines.append(np.column_stack([WIDTH * row[0], np.zeros(len(t)), LENGTH * t]))
    return polylines_from(
        Polylines(np.vstack(lines), np.arange(0, len(SEEN_R) * SEEN_POINTS + 1, SEEN_POINTS))
    )


def _level(z: float) -> Floats:
    return np.array([(0.0, 0.0, z), (WIDTH, 0.0, z), (WIDTH, DEPTH, z), (0.0, DEPTH, z)])


def _wall(x: float, low: float, high: float) -> Floats:
    return np.array([(x, 0.0, low), (x, DEPTH, low), (x, DEPTH, high), (x, 0.0, high)])


def _ring(corners: Floats) -> Floats:
    """Return the boundary of an area with these corners (4, 3), landmark by landmark."""
    sides = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        count = int(np.ceil(np.linalg.norm(b - a) / LANDMARKS - 1e-9))
        sides.append(a + np.arange(count)[:, None] / count * (b - a))
    return np.vstack(sides)
