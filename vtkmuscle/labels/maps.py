"""Scene from a label map, with tendons for bare bellies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.mesh.solids import Solids, solids_of
from vtkmuscle.core.mesh.surface import survey
from vtkmuscle.core.types import Floats
from vtkmuscle.data.anatomy import plain_name
from vtkmuscle.data.arrays import blocks_of, checked_surface, field_array, field_string, surface_from
from vtkmuscle.data.attachments import ROLES
from vtkmuscle.data.isosurface import EVEN
from vtkmuscle.data.label_images import Label, LabelField, labels_in
from vtkmuscle.filters.attachment_estimator import NEAR
from vtkmuscle.filters.label_surfaces import SMOOTHING, LabelSurfaces
from vtkmuscle.labels.draft import Draft, add_landmarks, scale_of
from vtkmuscle.labels.guesses import LEFT_OUT, Guess
from vtkmuscle.labels.names import kind_of
from vtkmuscle.labels.reading import read_labels
from vtkmuscle.phantoms.implicit import Solid, thick_curve
from vtkmuscle.phantoms.meshing import mesh_of

#: Distance from the belly's end at which the belly's thickness gives the tendon's [mm].
INSIDE = 5.0
#: Points of a tendon's line, and smoothing rounds, enough to spread a bend over all points.
_POINTS, _ROUNDS = 24, 600


def with_tendon(
    belly: LabelField,
    surface: vtkPolyData,
    target: Floats,
    bones: Sequence[Solids],
    edge: float,
    scale: float,
) -> tuple[vtkPolyData, float, float]:
    """Return a belly with a tendon to ``target`` (3,), and the tendon's length and radius [mm].

    The tendon is a tube as thick as the belly's end. It starts at the point of the belly closest to the
    target, and follows the shortest line outside the bones. ``edge`` is the edge length of triangles [mm],
    ``scale`` the size of the animal against a human.
    """
    points, triangles = checked_surface(surface, "belly")
    tip = points[np.argmin(np.linalg.norm(points - target, axis=1))]
    inward = points.mean(axis=0) - tip
    inward /= np.linalg.norm(inward)
    thinnest = float(belly.spacing.max())
    depth = -float(belly.at(tip[None] + INSIDE * scale * inward)[0][0])
    thickest = max(thinnest, 5.0 * scale)  # 5 mm: an Achilles tendon of 80 mm^2
    radius = float(np.clip(depth, thinnest, thickest))
    line = taut_line(tip, target, bones, radius)
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    tube = np.vstack([tip + radius * inward, line])
    solid = Solid(belly.at, points.min(axis=0), points.max(axis=0))
    solid = solid.joined(thick_curve(tube, np.full(len(tube), radius)), radius)
    area = survey(points, triangles).area + 2.0 * np.pi * radius * length
    mesh = mesh_of(solid, min(0.5 * edge, 0.7 * radius), round(area / (EVEN * edge * edge)))
    return surface_from(*mesh), length, radius


def taut_line(start: Floats, end: Floats, bones: Sequence[Solids], radius: float) -> Floats:
    """Return the shortest line (24, 3) outside bones [mm].

    Each round moves a point half way to the mean of its neighbours, then out of bones. Near the ends, on the
    bones, the distance falls to 0.
    """
    fraction = np.linspace(0.0, 1.0, _POINTS)[:, None]
    line: Floats = (1.0 - fraction) * start + fraction * end
    clearance = np.minimum(radius, np.linalg.norm(line - end, axis=1))
    for _ in range(_ROUNDS):
        before = line.copy()
        line[1:-1] = 0.5 * line[1:-1] + 0.25 * (line[:-2] + line[2:])
        for bone in bones:
            low, high = bone.box
            within = np.all((line > low - radius) & (line < high + radius), axis=1)
            close = np.flatnonzero(np.asarray(within)[1:-1]) + 1
            if len(close):
                distance, outward = bone.exact(line[close])
                line[close] += np.maximum(clearance[close] - distance, 0.0)[:, None] * outward
        if np.abs(line - before).max() < 1e-3 * radius:
            break
    return line


#: Edge length of triangles: at most [mm], and in voxels, so that 95 % of the phantom hip's surface is within
#: 0.34 mm (benchmarks/bench_labels.py).
EDGE, EDGE_VOXELS = 3.0, 2.0
#: Fraction of a label in smaller pieces above which the label may hold two structures, such as both sides.
MOST_LEFT_OUT = 0.05


def draft_of_labels(
    path: str | PathLike[str],
    *,
    landmarks: Sequence[Path] = (),
    names: str | None = None,
    frame: str = "LPS",
    edge: float | None = None,
    announce: Callable[[str], None] = lambda _: None,
) -> Draft:
    """Return a scene of the bones and muscles in a segmentation.

    Parameters
    ----------
    path, names, frame
        As of :func:`~vtkmuscle.labels.reading.read_labels`.
    landmarks : sequence of Path, optional
        Files called MUSCLE_origin or MUSCLE_insertion, in the map's frame. A muscle that ends before its
        landmarks gets a tendon.
    edge : float, optional
        Edge length of triangles [mm]. Default: 2 voxels, at most 3 mm.
    announce : callable, optional
        Called with a line on each structure.

    Raises
    ------
    FileNotFoundError, ValueError
        If a file cannot be read, or has no bones and muscles.
    """
    draft = Draft(Path(path).name.partition(".")[0], frame=frame)
    labels: dict[str, Label] = {}
    images = [(image, labels_in(image, str(path))) for image in read_labels(path, names=names, frame=frame)]
    frames = [label.frame[:3, :3] for _, by_name in images for label in by_name.values()]
    voxel = float(min(abs(np.linalg.det(axes)) for axes in frames) ** (1 / 3))
    edge = edge or min(EDGE, EDGE_VOXELS * voxel)
    for image, by_name in images:
        used = [name for name in by_name if kind_of(name)]
        for name in (name for name in by_name if name not in used):
            announce(f"{name}: ignored, no bone or muscle has this name")
        if not used:
            continue
        for name, surface in blocks_of(LabelSurfaces(labels=",".join(used), edge=edge)(image)):
            plain, kind = plain_name(name), kind_of(name)
            labels[plain] = by_name[name]
            refused = _faults(draft, plain, f"{kind}s", surface)
            if not refused:
                (draft.bones if kind == "bone" else draft.muscles)[plain] = surface
            announce(f"{plain}: {kind}, {refused or _figures(surface)}")
    draft.scale = scale_of([*draft.bones.values(), *draft.muscles.values()])
    draft.within = max(NEAR * draft.scale, *(np.linalg.norm(axes, axis=0).max() for axes in frames))
    add_landmarks(draft, landmarks)
    for muscle in list(draft.muscles):
        _draw_tendons(draft, muscle, labels[muscle], edge)
    draft.complete()
    return draft


def _figures(surface: vtkPolyData) -> str:
    """Return a surface's accuracy in words."""
    error, distance = _value(surface, "VolumeError"), _value(surface, "BoundaryDistance", 1)
    sizes = f"{surface.GetNumberOfCells()} triangles, volume {100.0 * error:+.2f} %"
    return f"{sizes}, 95 % of the surface within {distance:.2f} mm of the label"


def _faults(draft: Draft, name: str, kind: str, surface: vtkPolyData) -> str:
    """Note the faults of a label; return a refusal's reason."""
    reason = field_string(surface, "Refused")
    if reason is not None:
        draft.guesses.append(Guess(f"{kind}.{name}", LEFT_OUT, 0.0, reason))
        if kind == "muscles":
            draft.left_out[name] = reason
        return f"left out: {reason}"
    left_out, cut, pieces = (_value(surface, key) for key in ("LeftOut", "Cut", "Pieces"))
    if left_out > MOST_LEFT_OUT:
        why = f"the largest of {pieces:.0f} pieces lacks {100 * left_out:.0f} % of the label; split sides"
        draft.guesses.append(Guess(f"{kind}.{name}.surface", "the largest piece", 0.5 - 0.5 * left_out, why))
    if cut:
        why = f"the image's border cuts the label in {cut:.0f} voxels; the part beyond is missing"
        draft.guesses.append(Guess(f"{kind}.{name}.surface", "closed at the border", 0.3, why))
    return ""


def _value(surface: vtkPolyData, name: str, number: int = 0) -> float:
    """Return a value in a field array of a label's surface."""
    return float(np.asarray(field_array(surface, name), dtype=np.float64).ravel()[number])


def _draw_tendons(draft: Draft, muscle: str, label: Label, edge: float) -> None:
    """Add tendons to landmarks out of reach."""
    for number, area in enumerate(draft.areas.get(muscle, [])):
        surface = draft.muscles[muscle]
        gap = float(solids_of(*checked_surface(surface, muscle)).distances(area.landmarks).min())
        if area.role not in ROLES or gap <= draft.within:
            continue
        candidates = draft.candidate_bones(muscle)
        bones = {name: solids_of(*checked_surface(bone, name)) for name, bone in candidates.items()}
        middle = area.landmarks.mean(axis=0)
        distance, outward = bones[area.bone].exact(middle[None])
        target = middle - distance[0] * outward[0]
        solids, field = [*bones.values()], label.field(SMOOTHING)
        made = with_tendon(field, surface, target, solids, edge, draft.scale)
        draft.muscles[muscle], length, radius = made
        axes = np.linalg.svd(outward)[2][1:]
        angles = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
        ring = target + radius * (np.column_stack([np.cos(angles), np.sin(angles)]) @ axes)
        draft.areas[muscle][number] = replace(area, landmarks=ring, closed=True, estimated=True)
        why = f"the label ends {gap:.0f} mm from the landmarks of its {area.role}: a tube of radius "
        why += f"{radius:.1f} mm is added, without fibres"
        value = f"tendon of {length:.0f} mm"
        draft.guesses.append(Guess(f"muscles.{muscle}.surface", value, 0.3, why))
