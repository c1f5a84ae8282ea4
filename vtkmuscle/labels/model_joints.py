"""Joints of a draft from an OpenSim model, by names of bodies."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.motion.coordinates import ANGLES, MILLIMETRES
from vtkmuscle.core.motion.rigid import inverses
from vtkmuscle.data.anatomy import JOINTS, has_word, side_of, stem_of
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.joints.osim import read_tree
from vtkmuscle.joints.tree import KinematicTree
from vtkmuscle.labels.guesses import Guess, Joints, Sweep

#: Largest turn of a drafted motion [degrees], as of the fitted joints.
MOST = max(kind.most for kind in JOINTS)


def joints_of_model(
    file: Path, bones: Mapping[str, vtkPolyData]
) -> tuple[dict[str, Any], Joints, Sweep, list[Guess]]:
    """Return a draft's joints from a model.

    Keys of ``[opensim]``, joints between bones, first and last angles by coordinate, and guesses. A bone is
    the body of the same name, or of another word for the same part of a limb. Surfaces [mm] are in the frame,
    of the model's root or of a body, in which the centres of the joints are nearest to the bones. ValueError
    if the file is no model, a bone is no body, or the surfaces fit no frame.
    """
    tree = read_tree(file).scaled(MILLIMETRES["m"])
    bodies = {bone: _body(bone, tree.bodies, file) for bone in bones}
    first = {body: bone for bone, body in reversed(bodies.items())}
    joints, sweep = _joints(tree, bodies, first)
    frame, gap, size = _frame(tree, bodies, bones, joints)
    named = {bone: body for bone, body in bodies.items() if bone != body}
    guesses = [Guess("opensim.bodies", f"{bone}: {named[bone]}", 0.8, "by the names") for bone in named]
    why = f"the model's joints are {gap:.0f} mm from the surfaces of the bones, of {size:.0f} mm"
    if gap >= size:
        raise InputError(file, why, "move the surfaces into the frame of a body of the model")
    guesses.append(Guess("opensim.frame", frame, max(0.0, 1.0 - gap / size), why))
    return {"frame": frame, **({"bodies": named} if named else {})}, joints, sweep, guesses


def _body(bone: str, bodies: Iterable[str], file: Path) -> str:
    """Return the body of a bone.

    A bone without a body has that of the bone that it moves with, as a fibula of the tibia.
    """
    near = [body for body in bodies if side_of(bone) in (None, side_of(body)) or side_of(body) is None]
    words = [words for kind in JOINTS for words in (kind.children, kind.parents) if has_word(bone, words)]
    words += [kind.parents for kind in JOINTS if kind.form == "weld" and has_word(bone, kind.children)]
    same = [body for body in near if stem_of(body) == stem_of(bone)]
    same = same or [body for body in near if any(has_word(body, each) for each in words)]
    if len(same) != 1:
        remedy = f"name the mesh as one of the bodies: {', '.join(same or bodies)}"
        raise InputError(file, f"{'several bodies' if same else 'no body'} may be the bone {bone!r}", remedy)
    return same[0]


def _joints(tree: KinematicTree, bodies: Mapping[str, str], first: Mapping[str, str]) -> tuple[Joints, Sweep]:
    """Return joints by child, and first and last angles of the widest coordinates."""
    joints: Joints = {}
    sweep: Sweep = {}
    for bone, body in bodies.items():
        above = (joint.parent for joint in tree.way_up(body) if joint.parent in first)
        parent = body if first[body] != bone else next(above, None)
        if parent is None:
            continue
        crossed = [tree.coordinate(name) for name in tree.crossed([body, parent])]
        joints[bone] = {"parent": first[parent], "child": bone, "type": "custom" if crossed else "weld"}
        turns = [each for each in crossed if each.is_angle and np.ptp(each.range or 0.0) and not each.locked]
        if turns:
            widest = max(turns, key=lambda each: float(np.ptp(each.range or 0.0)))
            rest, *ends = np.array([widest.rest, *(widest.range or ())]) / ANGLES["deg"]
            end = max(reversed(ends), key=lambda end: abs(end - rest))
            sweep[widest.name] = round(rest, 6), round(float(np.clip(end, rest - MOST, rest + MOST)), 6)
    return joints, sweep


def _frame(
    tree: KinematicTree, bodies: Mapping[str, str], bones: Mapping[str, vtkPolyData], joints: Joints
) -> tuple[str, float, float]:
    """Return the frame of the surfaces.

    The mean distance of the joints' centres from the bones, and the bones' mean size [mm], follow.
    """
    solids = {name: solids_of(*checked_surface(bone, name)) for name, bone in bones.items()}
    size = float(np.mean([np.linalg.norm(np.ptp(solid.box, axis=0)) for solid in solids.values()]))
    poses, child_frames = tree.poses({}), {joint.child: joint.child_frame for joint in tree.joints}
    moving = [joint for joint in joints.values() if joint["type"] != "weld"]
    gaps = {}
    for frame in (tree.root, *dict.fromkeys(bodies.values())):
        away = [0.0] * (not moving)
        for joint in moving:
            body, seen = bodies[joint["child"]], inverses(poses[frame])[0]
            centre = seen @ poses[body][0] @ child_frames[body][:, 3]
            away += [abs(solids[joint[end]].distances(centre[None, :3])[0]) for end in ("parent", "child")]
        gaps[frame] = float(np.mean(away))
    frame = min(gaps, key=gaps.__getitem__)
    return frame, gaps[frame], size
