"""Scenes drafted from files or label maps, with tendons for bare bellies, and their page."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError, check_is_file
from vtkmuscle.core.mesh.solids import Solids, solids_of
from vtkmuscle.core.mesh.surface import NOISE, box_of, signed_volume, survey
from vtkmuscle.core.types import Floats
from vtkmuscle.data.anatomy import plain_name
from vtkmuscle.data.arrays import (
    blocks_of,
    checked_surface,
    field_array,
    field_string,
    multiblock_from,
    points_of,
    surface_from,
)
from vtkmuscle.data.attachments import ROLES
from vtkmuscle.data.label_images import EVEN, Label, LabelField, labels_in
from vtkmuscle.filters.attachment_estimator import NEAR
from vtkmuscle.filters.label_surfaces import SMOOTHING, LabelSurfaces
from vtkmuscle.io.writing import Outputs
from vtkmuscle.labels.draft import Draft, add_landmarks, draft_of_files, named_area, scale_of
from vtkmuscle.labels.guesses import LEFT_OUT, LOOK, table_of
from vtkmuscle.labels.reading import kind_of, read_labels
from vtkmuscle.phantoms.implicit import Solid, thick_curve
from vtkmuscle.phantoms.meshing import mesh_of
from vtkmuscle.plotting.views import DrawnBones
from vtkmuscle.report.data import MOST, Pack, packed_bones, packed_lines, packed_surface
from vtkmuscle.report.page import Section, write_sections

#: Name of the page.
PAGE = "guesses.html"


def init(
    files: Iterable[str | PathLike[str]],
    out: str | PathLike[str] = ".",
    *,
    bones: Sequence[str] = (),
    muscles: Sequence[str] = (),
    frame: str = "LPS",
    repair: bool = False,
    overwrite: bool = False,
) -> Draft:
    """Write a scene.toml from meshes and landmarks, guessing missing input.

    The draft's ``file`` is the scene.toml; ``guesses`` have confidences, ``left_out`` reasons by muscle, and
    ``lacks`` is the reason of a scene that cannot run yet, as without a joint.

    Parameters
    ----------
    files : iterable of path
        Surfaces, recognised by name, and landmarks called MUSCLE_origin, MUSCLE_insertion or MUSCLE_via. An
        OpenSim model (.osim) gives the joints; its bodies have the names of the bones.
    out : path, optional
        Folder of the scene, by default the working folder.
    bones, muscles : sequence of str, optional
        File names, without endings, of bones and muscles with unrecognised names.
    frame : str, optional
        Frame of the files, ``"LPS"`` or ``"RAS"``.
    repair : bool, optional
        Whether muscles are closed, oriented, and freed of small parts, where holes and lost parts are at
        most a hundredth; the repaired surfaces are written beside the scene.
    overwrite : bool, optional
        Whether files from elsewhere are replaced; inputs never are.

    Raises
    ------
    OSError, ValueError
        If a file cannot be read or written, or its name is not recognised.

    Examples
    --------
    >>> import vtkmuscle
    >>> draft = vtkmuscle.init(["femur_r.stl", "pelvis.stl", "iliacus.stl"], "hip")  # doctest: +SKIP
    >>> result = vtkmuscle.Scene.load(draft.file).run()  # doctest: +SKIP
    """
    inputs = [Path(file) for file in ([files] if isinstance(files, str | PathLike) else files)]
    folder = Path(out)
    outputs = Outputs.for_file(folder / "scene.toml", inputs, overwrite=overwrite)
    stated = dict.fromkeys(map(plain_name, bones), "bone") | dict.fromkeys(map(plain_name, muscles), "muscle")
    models = [file for file in inputs if file.suffix.lower() == ".osim"]
    if len(models) > 1:
        raise InputError(models[1], f"another model is {models[0]}", "give one model")
    surfaces = [file for file in inputs if file not in models]
    draft = draft_of_files(surfaces, folder, stated, frame, repair=repair)
    draft.model = next(iter(models), None)
    draft.complete()
    return _written(draft, outputs, folder)


def from_labels(
    label_map: str | PathLike[str],
    out: str | PathLike[str],
    *,
    landmarks: Iterable[str | PathLike[str]] = (),
    names: str | None = None,
    overwrite: bool = False,
    **options: Any,
) -> Draft:
    """Write a scene.toml from a segmentation: surfaces, attachment areas, fitted joints.

    The draft is as of :func:`init`.

    Parameters
    ----------
    label_map : path
        A .nii.gz, .nrrd, .mha or .dcm file, or a folder of files.
    out : path
        Folder of the scene.
    landmarks : iterable of path, optional
        Files called MUSCLE_origin or MUSCLE_insertion, in the map's frame.
    names : str, optional
        ``"musclemap"``, a task of TotalSegmentator, or a .csv of names by label.
    overwrite : bool, optional
        Whether files from elsewhere are replaced; inputs never are.
    **options
        ``frame``, ``edge`` and ``announce`` of :func:`~vtkmuscle.labels.draft_of_labels`.

    Raises
    ------
    OSError, ValueError
        If a file cannot be read or written, or the map has no bones and muscles.
    """
    folder, files = Path(out), [Path(file) for file in landmarks]
    inputs = [Path(label_map), *files, *filter(Path.is_file, [Path(names or "")])]
    outputs = Outputs.for_file(folder / "scene.toml", inputs, overwrite=overwrite)
    draft = draft_of_labels(label_map, landmarks=files, names=names, **options)
    return _written(replace(draft, name=folder.resolve().name), outputs, folder)


def _written(draft: Draft, outputs: Outputs, folder: Path) -> Draft:
    """Write a draft, and its page with the scene in three dimensions."""
    rows = [("structure", "kind", "triangles", "volume [cm³]", "against the label", "95 % within")]
    for kind, surfaces in (("bone", draft.bones), ("muscle", draft.muscles)):
        rows += [(name, kind, *_figures(surface)) for name, surface in surfaces.items()]
    sections, lead = [Section("Surfaces", rows=rows)], "Surfaces and guesses of the drafted scene."
    with outputs:
        draft.write(folder)
        values = _page_values(draft)
        write_sections(folder / PAGE, draft.name, "draft", lead, sections, "guesses.html", **values)
    return draft


#: Colours on the page, of muscles and of lines.
MUSCLE, COLOURS = "#b4443c", {"given": "#1f5fbf", "estimated": "#e08a00", "axes": "#12633a"}
#: Half length of a joint's axis on the page [mm], of an adult: longer than a femur's head is wide.
_HALF_AXIS = 50.0


def _page_values(draft: Draft) -> dict[str, Any]:
    """Return the content of a draft's page."""
    pack, muscles = Pack(), []

    def add(name: str, kind: str, lines: Sequence[Any]) -> None:
        """Add lines, shown with the muscle of the name."""
        if lines:
            packed = packed_lines(np.vstack(lines)[None], np.array([len(line) for line in lines]), pack)
            look = {"name": name, "colour": COLOURS[kind], "width": 3}
            muscles.append({**look, "surface": None, "fibres": packed})

    for name, muscle in draft.muscles.items():
        surface = packed_surface(muscle, [points_of(muscle)], MOST, pack)
        muscles.append({"name": name, "colour": MUSCLE, "surface": surface, "fibres": None})
        rings: dict[str, list[Any]] = {"given": [], "estimated": []}
        for area in draft.areas.get(name, []):
            ring = [*area.landmarks, *area.landmarks[: area.closed]]
            rings["estimated" if area.estimated else "given"].append(ring)
        for kind, lines in rings.items():
            add(name, kind, lines)
    for joint in draft.joints.values():
        axes = _HALF_AXIS * draft.scale * np.array(joint.get("axes") or [joint.get("axis", (0.0, 0.0, 0.0))])
        add("", "axes", [joint["centre"] + axis * np.array([[-1.0], [1.0]]) for axis in axes if axis.any()])
    bones = packed_bones(DrawnBones(multiblock_from(draft.bones)), pack)
    front = -1 if draft.frame == "LPS" else 1
    scene = {"mm": 1.0, "bones": bones, "muscles": muscles, "view": {"towards": [0, front, 0]}}
    data = {"scene": scene, "guesses": table_of(draft.guesses)[1:], "text": draft.text}
    own = {"draft": draft, "look": LOOK, "colours": COLOURS, "front": front}
    return {"data": data, "arrays": Markup(pack.text()), **own}


def _figures(surface: vtkPolyData) -> tuple[str, str, str, str]:
    """Return a surface's triangles, volume and accuracy as text."""
    points, triangles = checked_surface(surface, "surface")
    error, distances = field_array(surface, "VolumeError"), field_array(surface, "BoundaryDistance")
    against = "" if error is None else f"{100.0 * error[0]:+z.2f} %"
    within = "" if distances is None else f"{distances[1]:.2f} mm"
    return str(len(triangles)), f"{signed_volume(points, triangles) / 1000.0:.1f}", against, within


#: Radius of the thickest tendon [mm], an Achilles tendon of 80 mm^2. As far from the belly's end the belly's
#: thickness gives the tendon's.
THICKEST = 5.0
#: Points of a tendon's line, and smoothing rounds, enough to spread a bend over all points.
_POINTS, _ROUNDS = 24, 600


def with_tendon(
    belly: LabelField, surface: vtkPolyData, target: Floats, bones: Sequence[Solids], edge: float,
    scale: float,
) -> tuple[vtkPolyData, float, float]:  # fmt: skip
    """Return a belly with a tendon to ``target`` (3,), and the tendon's length and radius [mm]."""
    points, triangles = checked_surface(surface, "belly")
    tip = points[np.argmin(np.linalg.norm(points - target, axis=1))]
    inward = points.mean(axis=0) - tip
    inward /= np.linalg.norm(inward)
    thinnest = float(belly.spacing.max())
    depth = -float(belly.at(tip[None] + THICKEST * scale * inward)[0][0])
    radius = max(thinnest, min(depth, THICKEST * scale))
    line = taut_line(tip, target, bones, radius)
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    tube = np.vstack([tip + radius * inward, line])
    solid = Solid(belly.at, *box_of(points))
    solid = solid.joined(thick_curve(tube, np.full(len(tube), radius)), radius)
    area = survey(points, triangles).area + 2.0 * np.pi * radius * length
    mesh = mesh_of(solid, min(0.5 * edge, 0.7 * radius), round(area / (EVEN * edge * edge)))
    return surface_from(*mesh), length, radius


def taut_line(start: Floats, end: Floats, bones: Sequence[Solids], radius: float) -> Floats:
    """Return the shortest line (24, 3) outside bones [mm]."""
    line: Floats = np.linspace(start, end, _POINTS)
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


#: Edge length of triangles, in voxels, so that 95 % of the phantom hip's surface is within 0.34 mm
#: (benchmarks/bench_labels.py).
EDGE_VOXELS = 2.0


def draft_of_labels(
    path: str | PathLike[str], *, landmarks: Sequence[Path] = (), names: str | None = None,
    frame: str = "LPS", edge: float | None = None, announce: Callable[[str], None] = lambda _: None,
) -> Draft:  # fmt: skip
    """Return a scene of the bones and muscles in a segmentation, as of :func:`from_labels`.

    A muscle that ends before its landmarks gets a tendon; ``announce`` is called with a line on each
    structure. FileNotFoundError or ValueError if a file cannot be read, or has no bones and muscles.
    """
    draft = Draft(Path(path).name.partition(".")[0], frame=frame)
    labels: dict[str, Label] = {}
    images = [(image, labels_in(image, str(path))) for image in read_labels(path, names=names, frame=frame)]
    muscles = [plain_name(name) for _, by_name in images for name in by_name if kind_of(name) == "muscle"]
    for file in landmarks:  # before the surfaces take their time
        check_is_file(file)
        named_area(file, muscles)
    frames = [label.frame[:3, :3] for _, by_name in images for label in by_name.values()]
    voxel = float(min(abs(np.linalg.det(axes)) for axes in frames) ** (1 / 3))
    edge = min(LabelSurfaces().edge, EDGE_VOXELS * voxel) if edge is None else edge
    for image, by_name in images:
        used = [name for name in by_name if kind_of(name)]
        for name in (name for name in by_name if name not in used):
            announce(f"{name}: ignored, no bone or muscle has this name")
        if not used:
            continue
        for name, surface in blocks_of(LabelSurfaces(labels=",".join(used), edge=edge)(image)):
            plain, kind = plain_name(name), kind_of(name)
            if plain in labels:
                raise InputError(str(path), f"two labels are called {plain!r}", "rename or remove one")
            labels[plain] = by_name[name]
            refused = _faults(draft, plain, f"{kind}s", surface)
            if not refused:
                (draft.bones if kind == "bone" else draft.muscles)[plain] = surface
            words = "{0} triangles, volume {2} off the label's, 95 % of the surface within {3}"
            announce(f"{plain}: {kind}, {refused or words.format(*_figures(surface))}")
    draft.scale = scale_of([*draft.bones.values(), *draft.muscles.values()])
    draft.within = max(NEAR * draft.scale, *(np.linalg.norm(axes, axis=0).max() for axes in frames))
    add_landmarks(draft, landmarks)
    for muscle in list(draft.muscles):
        _draw_tendons(draft, muscle, labels[muscle], edge)
    draft.complete()
    return draft


def _faults(draft: Draft, name: str, kind: str, surface: vtkPolyData) -> str:
    """Note the faults of a label; return a refusal's reason."""
    reason = field_string(surface, "Refused")
    if reason is not None:
        if kind == "muscles":
            draft.leave_out(name, reason)
        else:
            draft.guess(f"{kind}.{name}", LEFT_OUT, 0.0, reason)
        return f"left out: {reason}"
    shares = (field_array(surface, key) for key in ("LeftOut", "Cut", "Pieces"))
    left_out, cut, pieces = (float(share[0]) for share in shares if share is not None)
    if left_out > NOISE:  # the label may hold two structures, such as both sides
        why = f"the largest of {pieces:.0f} pieces lacks {100 * left_out:.0f} % of the label; split sides"
        draft.guess(f"{kind}.{name}.surface", "the largest piece", 0.5 - 0.5 * left_out, why)
    if cut:
        why = f"the image's border cuts the label in {cut:.0f} voxels; the part beyond is missing"
        draft.guess(f"{kind}.{name}.surface", "closed at the border", 0.3, why)
    return ""


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
        draft.muscles[muscle], length, radius = with_tendon(field, surface, target, solids, edge, draft.scale)
        axes = np.linalg.svd(outward)[2][1:]
        angles = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
        ring = target + radius * (np.column_stack([np.cos(angles), np.sin(angles)]) @ axes)
        draft.areas[muscle][number] = replace(area, landmarks=ring, closed=True, estimated=True)
        why = f"the label ends {gap:.0f} mm from the landmarks of its {area.role}: a tube of radius "
        why += f"{radius:.1f} mm is added, without fibres"
        draft.guess(f"muscles.{muscle}.surface", f"tendon of {length:.0f} mm", 0.3, why)
