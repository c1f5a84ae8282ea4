"""A scene from files of meshes and landmarks, recognised by their names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from os.path import relpath
from pathlib import Path

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import checked_surface, points_of, with_points
from vtkmuscle.data.attachments import ROLES, VIA, AttachmentArea
from vtkmuscle.io import read_landmarks, read_surface
from vtkmuscle.io.surfaces import SURFACE_SUFFIXES
from vtkmuscle.labels.draft import Draft
from vtkmuscle.labels.guesses import Guess
from vtkmuscle.labels.names import kind_of, plain_name, side_of
from vtkmuscle.scene.data import MILLIMETRES

#: The longest side of all bones of a scene is 20 mm to 2 m: a smaller number in a file is not in mm.
SHORTEST_IN_MILLIMETRES = 10.0
LONGEST_IN_METRES = 2.5
#: Landmarks are a ring where the last is no farther from the first than this many usual steps.
RING_GAP = 2.0
_AREA = re.compile(rf"^(.+)_({'|'.join((*ROLES, VIA))})(?:_(.*))?$")


def likely_unit(longest: float) -> tuple[str, float]:
    """Return the unit in which the longest side of a body part has that length, and how sure that is.

    Examples
    --------
    >>> from vtkmuscle.labels.meshes import likely_unit
    >>> likely_unit(431.0), likely_unit(0.43), likely_unit(4.1)
    (('mm', 0.9), ('m', 0.9), ('cm', 0.3))
    """
    if longest >= SHORTEST_IN_MILLIMETRES:
        return "mm", 0.9
    return ("m", 0.9) if longest <= LONGEST_IN_METRES else ("cm", 0.3)


def draft_of_files(
    files: Sequence[Path],
    out: Path,
    *,
    bones: Sequence[str] = (),
    muscles: Sequence[str] = (),
    frame: str = "LPS",
) -> Draft:
    """Return a scene of meshes and landmarks, not yet complete.

    Parameters
    ----------
    files : sequence of Path
        Surfaces, recognised by their names, and landmarks called MUSCLE_origin, MUSCLE_insertion or
        MUSCLE_via, with a suffix after an underscore where there are several.
    out : Path
        The folder of the scene.
    bones, muscles : sequence of str
        Names of files, without their endings, that are bones or muscles whatever their names.
    frame : str, optional
        ``"LPS"`` or ``"RAS"``.

    Raises
    ------
    FileNotFoundError, ValueError
        If a file cannot be read, or its name is not recognised.
    """
    draft = Draft(out.resolve().name or "scene", frame=frame)
    landmarks, meshes = [], {}
    for file in files:
        name = plain_name(file.name.partition(".")[0])
        stated = {plain_name(one): "bone" for one in bones} | {plain_name(one): "muscle" for one in muscles}
        if _AREA.match(_roles_name(file)):
            landmarks.append(file)
            continue
        kind = stated.get(name) or kind_of(name)
        if kind is None or file.suffix.lower() not in SURFACE_SUFFIXES:
            remedy = "name it in --bone or --muscle, or call landmarks MUSCLE_origin or MUSCLE_insertion"
            raise InputError(file, "its name says neither bone nor muscle, and no area of a muscle", remedy)
        if name in meshes:
            raise InputError(file, f"there is another file of {name!r}", "leave one out, or rename it")
        meshes[name] = kind, read_surface(file)
        sure = 1.0 if name in stated else 0.8
        draft.guesses.append(Guess(f"{kind}s.{name}", kind, sure, f"it is a {kind} by its name, {file.name}"))
        draft.surfaces[f"{kind}s/{name}.vtp"] = Path(relpath(file, out)).as_posix()
    if not meshes:
        raise InputError("", "there is no surface of a bone or a muscle", "name files of meshes")
    boxes = [np.ptp(points_of(mesh), axis=0).max() for _, mesh in meshes.values()]
    draft.units, sure = likely_unit(float(max(boxes)))
    why = f"the longest of all surfaces is {max(boxes):.4g}"
    draft.guesses.append(Guess("units", draft.units, sure, why))
    scale = MILLIMETRES[draft.units]
    for name, (kind, mesh) in meshes.items():
        scaled = with_points(mesh, scale * points_of(mesh))
        getattr(draft, f"{kind}s")[name] = scaled
    add_landmarks(draft, landmarks, scale=scale)
    return draft


def _roles_name(file: Path) -> str:
    return "_".join(re.findall(r"[a-z0-9]+", file.name.partition(".")[0].casefold()))


def add_landmarks(draft: Draft, files: Sequence[Path], *, scale: float = 1.0) -> None:
    """Add landmarks to a draft: each file's to the muscle and the role in its name.

    The bone is the one that the name has after the role, else the nearest. Landmarks that end near where they
    began are a ring. ``scale`` converts the files' coordinates to mm.

    Raises
    ------
    FileNotFoundError, ValueError
        If a file cannot be read, or its name is not that of a muscle and a role.
    """
    for file in files:
        match = _AREA.match(_roles_name(file))
        muscle = plain_name(match[1]) if match else ""
        side = side_of(match[3]) if match and match[3] else None
        muscle = next((name for name in (muscle, f"{muscle}_{side}") if name in draft.muscles), "")
        if match is None or not muscle:
            known = ", ".join(draft.muscles) or "none"
            remedy = f"call it MUSCLE_origin or MUSCLE_insertion; muscles: {known}"
            raise InputError(file, "its name is not that of a muscle and a role", remedy)
        points, closed = read_landmarks(file, frame=draft.frame)
        points = scale * points
        rests = [bone for bone in draft.bones if match[3] and bone in plain_name(match[3])]
        gaps = _gaps(points, draft.bones_beside(muscle))
        bone = rests[0] if rests else min(gaps, key=gaps.__getitem__)
        if not rests:
            others = [gap for name, gap in gaps.items() if name != bone]
            sure = 1.0 - min(1.0, gaps[bone] / min(others)) if others else 1.0
            why = f"{match[2]} on {bone!r}, {gaps[bone]:.1f} mm from the landmarks in {file.name}"
            draft.guesses.append(Guess(f"muscles.{muscle}.attachments", f"{match[2]}: {bone}", sure, why))
        if not closed and len(points) > 3:
            steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
            gap = float(np.linalg.norm(points[-1] - points[0]) / max(float(np.median(steps)), 1e-9))
            closed = gap <= RING_GAP or match[2] == VIA
            why = f"{match[2]}: the last landmark is {gap:.1f} usual steps from the first"
            value = "a ring" if closed else "an open curve"
            draft.guesses.append(Guess(f"muscles.{muscle}.attachments", value, min(1.0, abs(gap - 2.0)), why))
        draft.areas.setdefault(muscle, []).append(AttachmentArea(match[2], bone, points, closed))


def _gaps(points: Floats, bones: Mapping[str, vtkPolyData]) -> dict[str, float]:
    """Return the mean distance of points from each bone [mm]."""
    return {
        name: float(np.abs(solids_of(*checked_surface(bone, name)).distances(points)).mean())
        for name, bone in bones.items()
    }
