"""A scene from mesh and landmark files, recognised by name."""

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

#: The longest side of a scene's bones is 20 mm to 2 m, so a smaller number is not in mm.
SHORTEST_IN_MILLIMETRES = 10.0
LONGEST_IN_METRES = 2.5
#: Largest gap between last and first landmark of a ring, in median steps.
RING_GAP = 2.0
_AREA = re.compile(rf"^(.+)_({'|'.join((*ROLES, VIA))})(?:_(.*))?$")


def likely_unit(longest: float) -> tuple[str, float]:
    """Return the likely unit of a longest side, and the confidence.

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
    """Return an incomplete scene of meshes and landmarks.

    Parameters
    ----------
    files : sequence of Path
        Surfaces, recognised by name, and landmarks called MUSCLE_origin, MUSCLE_insertion or MUSCLE_via,
        optionally with _SUFFIX for several.
    out : Path
        Folder of the scene.
    bones, muscles : sequence of str
        File names, without endings, of bones and muscles with unrecognised names.
    frame : str, optional
        ``"LPS"`` or ``"RAS"``.

    Raises
    ------
    FileNotFoundError, ValueError
        If a file cannot be read, or its name is not recognised.
    """
    draft = Draft(out.resolve().name or "scene", frame=frame)
    landmarks, meshes = [], {}
    stated = dict.fromkeys(map(plain_name, bones), "bone") | dict.fromkeys(map(plain_name, muscles), "muscle")
    for file in files:
        name = plain_name(file.name.partition(".")[0])
        if _AREA.match(_roles_name(file)):
            landmarks.append(file)
            continue
        kind = stated.get(name) or kind_of(name)
        if kind is None or file.suffix.lower() not in SURFACE_SUFFIXES:
            remedy = "use --bone NAME or --muscle NAME; call landmarks MUSCLE_origin or MUSCLE_insertion"
            problem = "the file name has no known bone, muscle, or area of a muscle"
            raise InputError(file, problem, remedy)
        if name in meshes:
            raise InputError(file, f"another file has the name {name!r}", "remove or rename a file")
        meshes[name] = kind, read_surface(file)
        confidence = 1.0 if name in stated else 0.8
        why = f"a {kind} by its name, {file.name}"
        draft.guesses.append(Guess(f"{kind}s.{name}", kind, confidence, why))
        draft.surfaces[f"{kind}s/{name}.vtp"] = Path(relpath(file, out)).as_posix()
    if not meshes:
        raise InputError("", "there is no surface of a bone or a muscle", "give mesh files")
    longest = float(max(np.ptp(points_of(mesh), axis=0).max() for _, mesh in meshes.values()))
    draft.units, confidence = likely_unit(longest)
    why = f"the longest side of all surfaces is {longest:.4g}"
    draft.guesses.append(Guess("units", draft.units, confidence, why))
    scale = MILLIMETRES[draft.units]
    for name, (kind, mesh) in meshes.items():
        getattr(draft, f"{kind}s")[name] = with_points(mesh, scale * points_of(mesh))
    add_landmarks(draft, landmarks, scale=scale)
    return draft


def _roles_name(file: Path) -> str:
    return "_".join(re.findall(r"[a-z0-9]+", file.name.partition(".")[0].casefold()))


def add_landmarks(draft: Draft, files: Sequence[Path], *, scale: float = 1.0) -> None:
    """Add landmarks to a draft by their file names.

    A file's name has the muscle and the role.

    The bone is in the file's name after the role, or is the closest bone. Landmarks that end near their start
    are a ring. ``scale`` converts coordinates to mm.

    Raises
    ------
    FileNotFoundError, ValueError
        If a file cannot be read, or its name lacks a muscle or a role.
    """
    for file in files:
        match = _AREA.match(_roles_name(file))
        muscle = plain_name(match[1]) if match else ""
        side = side_of(match[3]) if match and match[3] else None
        muscle = next((name for name in (muscle, f"{muscle}_{side}") if name in draft.muscles), "")
        if match is None or not muscle:
            remedy = (
                f"rename it MUSCLE_origin or MUSCLE_insertion; muscles: {', '.join(draft.muscles) or 'none'}"
            )
            raise InputError(file, "the file name has no known muscle and role", remedy)
        key, role = f"muscles.{muscle}.attachments", match[2]
        points, closed = read_landmarks(file, frame=draft.frame)
        points = scale * points
        named = [bone for bone in draft.bones if match[3] and bone in plain_name(match[3])]
        gaps = _gaps(points, draft.candidate_bones(muscle))
        bone, *further = named or sorted(gaps, key=gaps.__getitem__)
        if not named:
            confidence = 1.0 - min(1.0, gaps[bone] / gaps[further[0]]) if further else 1.0
            why = f"{role} on {bone!r}, {gaps[bone]:.1f} mm from the landmarks in {file.name}"
            draft.guesses.append(Guess(key, f"{role}: {bone}", confidence, why))
        if not closed and len(points) > 3:
            steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
            gap = float(np.linalg.norm(points[-1] - points[0]) / max(float(np.median(steps)), 1e-9))
            closed = gap <= RING_GAP or role == VIA
            why = f"{role}: the last landmark is {gap:.1f} median steps from the first"
            value = "a ring" if closed else "an open curve"
            draft.guesses.append(Guess(key, value, min(1.0, abs(gap - RING_GAP)), why))
        draft.areas.setdefault(muscle, []).append(AttachmentArea(role, bone, points, closed))


def _gaps(points: Floats, bones: Mapping[str, vtkPolyData]) -> dict[str, float]:
    """Return the mean distance of points from each bone [mm]."""
    return {
        name: float(np.abs(solids_of(*checked_surface(bone, name)).distances(points)).mean())
        for name, bone in bones.items()
    }
