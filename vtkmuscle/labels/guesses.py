"""Guesses in a drafted scene, each with a confidence; joints by names and fits."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.bones.joint_fits import JointFit, fitted_ball, fitted_hinge, oriented_points
from vtkmuscle.core.errors import fault_of
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.anatomy import JOINTS, JointKind, has_word, side_of, stem_of
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.scene.sense import CHECKS

#: Confidence below which a guess should be checked before the results are used.
LOOK = CHECKS["estimate"]["confidence"]
#: Value of a guess about a structure that is missing in the scene.
LEFT_OUT = "left out"

#: Tables of joints by name.
Joints = dict[str, dict[str, Any]]
#: First and last angle [degrees] of a drafted motion, by coordinate.
Sweep = dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Guess:
    """A guess for ``what``, a key of a scene such as ``joints.hip_right.centre``.

    ``value`` may be "", ``confidence`` is from 0 to 1, ``why`` is the reason, or the missing information.
    """

    what: str
    value: str
    confidence: float
    why: str

    def __str__(self) -> str:
        mark = "  CHECK THIS" if self.confidence < LOOK else ""
        return f"confidence {self.confidence:.2f}: {self.why}{mark}"


def table_of(guesses: Sequence[Guess]) -> list[list[str]]:
    """Return a table of guesses by ascending confidence."""
    rows = sorted(guesses, key=lambda guess: guess.confidence)
    cells = [[f"{guess.confidence:.2f}", guess.what, guess.value, guess.why] for guess in rows]
    return [["confidence", "what", "guess", "why"], *cells]


#: Points of a bone face the other bone within this distance beyond the closest point [mm]. From 3 to 15 mm,
#: the centres of five hips and of a shoulder change by at most 0.5 mm.
FACING = 10.0


def guessed_joints(
    bones: Mapping[str, vtkPolyData], frame: str = "LPS", facing: float = FACING
) -> tuple[Joints, Sweep, list[Guess]]:
    """Return tables of joints by name, first and last angles [degrees] by coordinate, and guesses."""
    joints: Joints = {}
    sweep: Sweep = {}
    guesses: list[Guess] = []
    for child in bones:
        parents = ((kind, _parent(kind, child, bones)) for kind in JOINTS)
        kind, parent = next((pair for pair in parents if pair[1]), (JOINTS[0], None))
        if parent is None:
            continue
        side = side_of(child) or side_of(parent)
        named = f"{{}}_{side}" if side else "{}"
        form, name = kind.form, named.format(kind.name)
        if name in joints:  # of another part of the child, such as a tibia beside a shank
            parent, form = joints[name]["child"], "weld"
        if form == "weld":
            name = named.format(stem_of(child))
        table: dict[str, Any] = {"parent": parent, "child": child, "type": form}
        key = f"joints.{name}"
        if form == "weld":
            why = f"{child!r} moves with {parent!r}, by its name"
            guesses.append(Guess(f"{key}.parent", parent, 0.5, why))
        else:
            try:
                fit = _fit(kind, bones[child], bones[parent], facing)
            except ValueError as error:
                problem, remedy = fault_of(error)
                guesses.append(Guess(key, "", 0.0, f"{problem}: {child} does not move; {remedy}"))
                continue
            table |= _axes(kind, fit, side, frame)
            sweep[next(iter(table["coordinates"]))] = 0.0, kind.most
            guesses += _guesses_of(key, kind, fit, bones[child], frame, side)
        joints[name] = table
    return joints, sweep, guesses


def _parent(kind: JointKind, child: str, bones: Mapping[str, vtkPolyData]) -> str | None:
    """Return a bone's parent for a kind of joint, or None."""
    if not has_word(child, kind.children):
        return None
    sides = {"left", "right", None} if side_of(child) is None else {side_of(child), None}
    near = [bone for bone in bones if bone != child and side_of(bone) in sides]
    return next((bone for word in kind.parents for bone in near if has_word(bone, [word])), None)


def _fit(kind: JointKind, child: vtkPolyData, parent: vtkPolyData, depth: float) -> JointFit:
    rounded, facing = (child, parent) if kind.round_end == "child" else (parent, child)
    points, triangles = checked_surface(rounded, "bone")
    distances = solids_of(*checked_surface(facing, "bone")).distances(points)
    fitted = fitted_ball if kind.form == "ball" else fitted_hinge
    return fitted(oriented_points(points, triangles), distances < distances.min() + depth)


def _axes(kind: JointKind, fit: JointFit, side: str | None, frame: str) -> dict[str, Any]:
    """Return the keys of a joint: centre, axes and coordinates."""
    flip = np.array([-1.0, -1.0, 1.0]) if frame == "RAS" else np.ones(3)
    suffix = f"_{side[0]}" if side else ""
    signs = [1.0, -1.0, -1.0] if side == "left" else [1.0, 1.0, 1.0]
    axes = [sign * flip * np.array(axis) for sign, axis in zip(signs, kind.axes.values(), strict=False)]
    if fit.axis is not None:
        axes = [fit.axis * (1.0 if fit.axis @ axes[0] >= 0.0 else -1.0)]
    coordinates = {f"{name}{suffix}": {"positive": name.split("_")[1]} for name in kind.axes}
    listed = [[round(float(value), 6) for value in axis] for axis in axes]
    turns = {"axes": listed} if kind.form == "ball" else {"axis": listed[0]}
    return {"centre": [round(float(value), 3) for value in fit.centre], **turns, "coordinates": coordinates}


def _guesses_of(
    key: str, kind: JointKind, fit: JointFit, child: vtkPolyData, frame: str, side: str | None
) -> list[Guess]:
    shape = "a ball" if kind.form == "ball" else "two balls side by side"
    sizes = f"radius {fit.radius:.1f} mm, error {fit.rms:.2f} mm, {100 * fit.covered:.0f} % covered"
    centre = ", ".join(f"{value:.1f}" for value in fit.centre)
    hanging = checked_surface(child, "bone")[0].mean(axis=0) - fit.centre
    down = max(0.0, float(-hanging[2] / np.linalg.norm(hanging)))
    limb = "" if side or fit.axis is not None else ", of a right limb, as no name has a side"
    confidence = down if fit.axis is None else down * fit.confidence
    why = f"signs for a standing person in {frame}{limb}; the bone hangs down by {down:.2f} of its length"
    axes = Guess(f"{key}.{'axes' if fit.axis is None else 'axis'}", ", ".join(kind.axes), confidence, why)
    return [Guess(f"{key}.centre", centre, fit.confidence, f"{shape}: {sizes}"), axes]


def moving_chain(bone: str, joints: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the bones with moving joints from a bone upwards."""
    above = {table["child"]: table for table in joints.values()}
    chain = []
    while bone in above:
        chain += [bone] if above[bone]["type"] != "weld" else []
        bone = above[bone]["parent"]
    return chain
