"""Guessed joints: bones by name, centres and axes by fits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import fault_of
from vtkmuscle.core.mesh.normals import triangle_normals, vertex_normals
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.joints.fits import JointFit, fitted_ball, fitted_hinge
from vtkmuscle.labels.guesses import Guess
from vtkmuscle.labels.names import JOINTS, JointKind, side_of, stem_of

#: Points of a bone face the other bone within this distance beyond the closest point [mm]. From 3 to 15 mm,
#: the centres of five hips and of a shoulder change by at most 0.5 mm.
FACING = 10.0


def guessed_joints(
    bones: Mapping[str, vtkPolyData], *, frame: str = "LPS"
) -> tuple[dict[str, dict[str, Any]], dict[str, float], list[Guess]]:
    """Return the joint tables of a scene, in mm.

    Parameters
    ----------
    bones : mapping of str to vtkPolyData
        By name, in a standing pose [mm].
    frame : str, optional
        ``"LPS"`` or ``"RAS"``.

    Returns
    -------
    joints : dict
        Tables of ``[joints.NAME]``, by name.
    sweep : dict of str to float
        Largest angle [degrees], by coordinate to move.
    guesses : list of Guess
        For parents, centres, axes, and joints without a fit.
    """
    joints: dict[str, dict[str, Any]] = {}
    sweep: dict[str, float] = {}
    guesses: list[Guess] = []
    for child in bones:
        for kind in JOINTS:
            parent = _parent(kind, child, bones)
            if parent is None:
                continue
            side = side_of(child) or side_of(parent)
            name = "_".join([kind.name if kind.form != "weld" else stem_of(child), *([side] if side else [])])
            table: dict[str, Any] = {"parent": parent, "child": child, "type": kind.form}
            key = f"joints.{name}"
            if kind.form == "weld":
                why = f"{child!r} moves with {parent!r}, by its name"
                guesses.append(Guess(f"{key}.parent", parent, 0.5, why))
            else:
                try:
                    fit = _fit(kind, bones[child], bones[parent])
                except ValueError as error:
                    problem, remedy = fault_of(error)
                    guesses.append(Guess(key, "", 0.0, f"{problem}: {child} does not move; {remedy}"))
                    break
                table |= _axes(kind, fit, side, frame)
                sweep[next(iter(table["coordinates"]))] = kind.most
                guesses += _guesses_of(key, kind, fit, bones[child], frame)
            joints[name] = table
            break
    return joints, sweep, guesses


def _parent(kind: JointKind, child: str, bones: Mapping[str, vtkPolyData]) -> str | None:
    """Return a bone's parent for a kind of joint, or None."""
    if not set(kind.children) & set(stem_of(child).split("_")):
        return None
    sides = {side_of(child), None}
    for word in kind.parents:
        for bone in bones:
            same = side_of(bone) in sides or side_of(child) is None
            if bone != child and same and word in stem_of(bone).split("_"):
                return bone
    return None


def _fit(kind: JointKind, child: vtkPolyData, parent: vtkPolyData) -> JointFit:
    rounded, facing = (child, parent) if kind.round_end == "child" else (parent, child)
    points, triangles = checked_surface(rounded, "bone")
    areas = np.linalg.norm(triangle_normals(points, triangles), axis=1) / 6.0
    areas = np.bincount(triangles.ravel(), np.repeat(areas, 3), len(points)).astype(np.float64)
    distances = solids_of(*checked_surface(facing, "bone")).distances(points)
    fitted = fitted_ball if kind.form == "ball" else fitted_hinge
    facing_points = distances < distances.min() + FACING
    return fitted(points, vertex_normals(points, triangles), areas, facing_points)


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
    return {
        "centre": [round(float(value), 3) for value in fit.centre],
        **({"axes": listed} if kind.form == "ball" else {"axis": listed[0]}),
        "coordinates": coordinates,
    }


def _guesses_of(key: str, kind: JointKind, fit: JointFit, child: vtkPolyData, frame: str) -> list[Guess]:
    shape = "a ball" if kind.form == "ball" else "two balls side by side"
    sizes = f"radius {fit.radius:.1f} mm, error {fit.rms:.2f} mm, {100 * fit.covered:.0f} % covered"
    centre = ", ".join(f"{value:.1f}" for value in fit.centre)
    hanging = checked_surface(child, "bone")[0].mean(axis=0) - fit.centre
    down = max(0.0, -float(hanging[2]) / float(np.linalg.norm(hanging)))
    confidence = down if fit.axis is None else down * fit.confidence
    why = f"signs for a standing person in {frame}; the bone hangs down by {down:.2f} of its length"
    axes = f"{key}.{'axes' if fit.axis is None else 'axis'}"
    return [
        Guess(f"{key}.centre", centre, fit.confidence, f"{shape}: {sizes}"),
        Guess(axes, ", ".join(kind.axes), confidence, why),
    ]


def moving_chain(bone: str, joints: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return the bones with moving joints from a bone upwards."""
    above = {table["child"]: table for table in joints.values()}
    chain = []
    while bone in above:
        chain += [bone] if above[bone]["type"] != "weld" else []
        bone = above[bone]["parent"]
    return chain


def bodies_of(bones: Mapping[str, vtkPolyData], joints: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Return the rigid body of each bone; "" at rest."""
    return {bone: (moving_chain(bone, joints) or [""])[0] for bone in bones}
