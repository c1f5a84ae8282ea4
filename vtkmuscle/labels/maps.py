"""A scene from a label map."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.data.arrays import blocks_of, checked_surface, field_array, field_string
from vtkmuscle.data.attachments import ROLES
from vtkmuscle.data.estimated_areas import NEAR
from vtkmuscle.data.label_images import Label, labels_in
from vtkmuscle.filters.label_surfaces import SMOOTHING, LabelSurfaces
from vtkmuscle.labels.draft import Draft
from vtkmuscle.labels.guesses import LEFT_OUT, Guess
from vtkmuscle.labels.meshes import add_landmarks
from vtkmuscle.labels.names import kind_of, plain_name
from vtkmuscle.labels.reading import read_labels
from vtkmuscle.labels.tendons import with_tendon

#: A label whose other pieces are more than this part of it may be two things: both sides in one, for example.
MOST_LEFT_OUT = 0.05
#: Landmarks around a tendon's end.
RING = 12


def draft_of_labels(
    path: str | PathLike[str],
    *,
    landmarks: Sequence[Path] = (),
    names: str | None = None,
    frame: str = "LPS",
    edge: float = 3.0,
    announce: Callable[[str], None] = lambda _: None,
) -> Draft:
    """Return a scene of the bones and muscles of a segmentation.

    Parameters
    ----------
    path, names, frame
        As of :func:`~vtkmuscle.labels.reading.read_labels`.
    landmarks : sequence of Path, optional
        Files called MUSCLE_origin or MUSCLE_insertion, in the map's frame; to those that a muscle does not
        reach a tendon is drawn.
    edge : float, optional
        Length of the triangles' edges [mm].
    announce : callable, optional
        Called with a line on each structure.

    Raises
    ------
    FileNotFoundError, ValueError
        If a file cannot be read, no joint can be found, or no muscle can be made.
    """
    draft = Draft(Path(path).name.partition(".")[0], frame=frame)
    labels: dict[str, Label] = {}
    for image in read_labels(path, names=names, frame=frame):
        found = labels_in(image, str(path))
        for name in (name for name in found if kind_of(name) is None):
            announce(f"{name}: passed over, its name is that of no bone or muscle that is known")
        wanted = [name for name in found if kind_of(name) is not None]
        if not wanted:
            continue
        for name, surface in blocks_of(LabelSurfaces(labels=",".join(wanted), edge=edge)(image)):
            plain, kind = plain_name(name), kind_of(name)
            labels[plain] = found[name]
            refused = _faults(draft, plain, f"{kind}s", surface)
            if not refused:
                (draft.bones if kind == "bone" else draft.muscles)[plain] = surface
            announce(f"{plain}: {kind}, {refused or _figures(surface)}")
    spacings = [np.linalg.norm(one.frame[:3, :3], axis=0).max() for one in labels.values()]
    draft.within = max(NEAR, float(max(spacings, default=0.0)))
    add_landmarks(draft, landmarks)
    for muscle in list(draft.muscles):
        _draw_tendons(draft, muscle, labels[muscle], edge)
    draft.complete()
    return draft


def _figures(surface: vtkPolyData) -> str:
    """Return in words how right a surface is."""
    error, away = _values(surface, "VolumeError")[0], _values(surface, "BoundaryDistance")[1]
    count = surface.GetNumberOfCells()
    return f"{count} triangles, volume {100.0 * error:+.2f} %, 95 % of it within {away:.2f} mm of the label"


def _faults(draft: Draft, name: str, kind: str, surface: vtkPolyData) -> str:
    """Note what is wrong with a label; return the reason where it has no surface."""
    reason = field_string(surface, "Refused")
    if reason is not None:
        draft.guesses.append(Guess(f"{kind}.{name}", LEFT_OUT, 0.0, reason))
        if kind == "muscles":
            draft.left_out[name] = reason
        return f"left out: {reason}"
    left_out, cut, pieces = (_values(surface, key)[0] for key in ("LeftOut", "Cut", "Pieces"))
    if left_out > MOST_LEFT_OUT:
        why = (
            f"of the {pieces:.0f} pieces of the label the largest lacks {100 * left_out:.0f} %; where it "
            "holds both sides, give each a label of its own"
        )
        draft.guesses.append(Guess(f"{kind}.{name}.surface", "the largest piece", 0.5 - 0.5 * left_out, why))
    if cut:
        why = f"the image's border cuts the label in {cut:.0f} voxels: what is beyond is missing"
        draft.guesses.append(Guess(f"{kind}.{name}.surface", "closed at the border", 0.3, why))
    return ""


def _values(surface: vtkPolyData, name: str) -> NDArray[Any]:
    """Return the values of a field array that LabelSurfaces gives every label."""
    values = field_array(surface, name)
    assert values is not None
    return values


def _draw_tendons(draft: Draft, muscle: str, label: Label, edge: float) -> None:
    """Draw tendons to landmarks that a muscle does not reach; its areas are then where these end."""
    for number, area in enumerate(draft.areas.get(muscle, [])):
        surface = draft.muscles[muscle]
        gap = float(solids_of(*checked_surface(surface, muscle)).distances(area.landmarks).min())
        if area.role not in ROLES or gap <= draft.within:
            continue
        beside = draft.bones_beside(muscle)
        bones = {name: solids_of(*checked_surface(bone, name)) for name, bone in beside.items()}
        middle = area.landmarks.mean(axis=0)
        distance, outward = bones[area.bone].exact(middle[None])
        target = middle - distance[0] * outward[0]
        tendon = with_tendon(label.field(SMOOTHING), surface, target, [*bones.values()], edge)
        draft.muscles[muscle] = tendon.surface
        # Where the tube stands on the bone.
        one, other = np.linalg.svd(outward)[2][1:]
        turns = np.linspace(0.0, 2.0 * np.pi, RING, endpoint=False)[:, None]
        ring = target + tendon.radius * (np.cos(turns) * one + np.sin(turns) * other)
        draft.areas[muscle][number] = replace(area, landmarks=ring, closed=True, estimated=True)
        why = (
            f"the label ends {gap:.0f} mm from the landmarks of its {area.role}: a tube of radius "
            f"{tendon.radius:.1f} mm is drawn there, and is no part of the fibres"
        )
        draft.guesses.append(
            Guess(f"muscles.{muscle}.surface", f"tendon of {tendon.length:.0f} mm", 0.3, why)
        )
