"""Draft of a scene, and drafts from mesh and landmark files, recognised by name."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os.path import relpath
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.attachments.patches import ring_sides
from vtkmuscle.core.errors import InputError, check_is_file, fault_of
from vtkmuscle.core.mesh.solids import solids_of
from vtkmuscle.core.mesh.surface import longest_side, survey
from vtkmuscle.core.motion.coordinates import MILLIMETRES
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.data.anatomy import plain_name, side_of
from vtkmuscle.data.arrays import checked_surface, points_of, with_points
from vtkmuscle.data.attachments import ROLES, VIA, AttachmentArea
from vtkmuscle.filters.attachment_estimator import NEAR
from vtkmuscle.io import read_landmarks, read_surface
from vtkmuscle.io.csv_table import write_rows
from vtkmuscle.io.surfaces import SURFACE_SUFFIXES, stated_frame
from vtkmuscle.io.writing import write_polydata, write_text
from vtkmuscle.labels.architecture import COLUMNS, architecture_row
from vtkmuscle.labels.guesses import FACING, LEFT_OUT, Guess, guessed_joints, moving_chain, table_of
from vtkmuscle.labels.model_joints import joints_of_model
from vtkmuscle.labels.reading import kind_of
from vtkmuscle.scene.checks import closed_surface, repaired_surface
from vtkmuscle.scene.data import words_of
from vtkmuscle.scene.reading import areas_in_contact, goes_round
from vtkmuscle.scene.sense import CHECKS, disorder, other_units
from vtkmuscle.scene.writing import inline_toml, write_areas

#: Fibres of each muscle.
FIBRES = {"template": "parallel", "n_fibres": 100, "resolution": 15}
_HEADER = """# Drafted by vtkmuscle. Missing information was guessed: the comment above a guess has the reason
# and a confidence from 0 to 1; guesses.csv lists all guesses. Paths are relative to this file.
"""
#: Columns of the table of surfaces.
VOLUMES = ("structure", "kind", "volume_mm3", "area_mm2", "triangles", *COLUMNS)
#: Remedy for a muscle that touches fewer than two bones.
GIVE = "give landmarks of the area: a file MUSCLE_origin or MUSCLE_insertion, as .csv, .mrk.json or .vtp"


@dataclass
class Draft:
    """A scene in preparation, in mm.

    ``bones`` and ``muscles`` are surfaces at rest, ``areas`` are by muscle, from landmarks or estimated.
    ``frame`` is of the surfaces, ``units`` of the written scene. ``surfaces`` are existing files, relative to
    the scene; missing files are written. Up to ``within`` [mm] a muscle and a bone are in contact; ``scale``
    is the size of the animal against a human. ``left_out`` has reasons, by muscle that cannot be made, and
    ``loose`` the surfaces of these muscles; ``joints`` and ``sweep`` are as of ``guessed_joints``, or of an
    OpenSim ``model``, with further keys ``opensim``. ``lacks`` is the reason of a scene that cannot run;
    ``file`` and ``text`` are of the written scene.toml.
    """

    name: str
    bones: dict[str, vtkPolyData] = field(default_factory=dict)
    muscles: dict[str, vtkPolyData] = field(default_factory=dict)
    areas: dict[str, list[AttachmentArea]] = field(default_factory=dict)
    frame: str = "LPS"
    units: str = "mm"
    surfaces: dict[str, str] = field(default_factory=dict)
    within: float = NEAR
    scale: float = 1.0
    guesses: list[Guess] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    loose: dict[str, vtkPolyData] = field(default_factory=dict)
    model: Path | None = None
    opensim: dict[str, Any] = field(default_factory=dict)
    joints: dict[str, dict[str, Any]] = field(default_factory=dict)
    sweep: dict[str, tuple[float, float]] = field(default_factory=dict)
    lacks: str = ""
    file: Path = Path("scene.toml")
    text: str = ""

    def __post_init__(self) -> None:
        self.name = " ".join(re.findall(r"[\w+-]+", self.name)).strip("+- ") or "scene"  # a file name

    def complete(self) -> None:
        """Guess joints and missing areas; leave out muscles without areas."""
        if self.model is not None:
            self.opensim, self.joints, self.sweep, guesses = joints_of_model(self.model, self.bones)
        else:
            self.joints, self.sweep, guesses = guessed_joints(self.bones, self.frame, FACING * self.scale)
        self.guesses += guesses
        if not self.sweep:
            why = "; ".join(g.why for g in guesses) or f"the bones are {', '.join(self.bones) or 'none'}"
            fitted = "hips, knees, shoulders and elbows are fitted, by names such as femur_r and pelvis"
            remedy = "give a model, an .osim with bodies of these names, or write a scene.toml, with bone, "
            remedy += "centre, axis and angles in [motion.hinge]"
            self.lacks = f"no joint was found between the bones: {why}; {fitted}; {remedy}"
            return
        for muscle in list(self.muscles):
            try:
                self._attach(muscle)
            except ValueError as error:
                self.leave_out(muscle, "; ".join(part for part in fault_of(error) if part))
        if not self.muscles:
            problem = "; ".join(f"{muscle}: {why}" for muscle, why in self.left_out.items())
            self.lacks = f"no muscle can be made: {problem or 'there is no surface of a muscle'}"

    def guess(self, what: str, value: str, confidence: float, why: str) -> None:
        """Note a guess for a key of the scene."""
        self.guesses.append(Guess(what, value, confidence, why))

    def leave_out(self, muscle: str, why: str) -> None:
        """Remove a muscle from the scene, and note the reason."""
        self.left_out[muscle] = why
        if muscle in self.muscles:
            self.loose[muscle] = self.muscles.pop(muscle)
        self.guess(f"muscles.{muscle}", LEFT_OUT, 0.0, why)

    def candidate_bones(self, muscle: str) -> dict[str, vtkPolyData]:
        """Return the bones on a muscle's side of the body."""
        side = side_of(muscle)
        return {name: bone for name, bone in self.bones.items() if not side or side_of(name) in (side, None)}

    def _attach(self, muscle: str) -> None:
        """Estimate the areas of a muscle without landmarks."""
        digitised = self.areas.get(muscle, [])
        named = {area.role: area.bone for area in digitised if area.role in ROLES}
        missing = [role for role in ROLES if role not in named]
        if not missing:
            return
        bones = self.candidate_bones(muscle)
        chains = {bone: moving_chain(bone, self.joints) for bone in bones}
        areas = areas_in_contact(self.muscles[muscle], bones, chains, within=self.within, **named)
        used = [*digitised, *(area for area in areas if area.role in missing)]
        if len({tuple(chains[area.bone][:1]) for area in used}) < 2:
            unfitted = [g.why for g in self.guesses if g.what.startswith("joints.") and not g.value]
            rigid = "; ".join([" and ".join(sorted({area.bone for area in used})), *unfitted])
            raise InputError("", f"both ends are on the same moving body: {rigid}", GIVE)
        for role in missing:
            ends = [area for area in areas if area.role == role]
            on = ", ".join(dict.fromkeys(area.bone for area in ends))
            confidence = min(area.confidence or 0.0 for area in ends)
            why = f"{role} on {on}, in contact with the muscle's end"
            self.guess(f"muscles.{muscle}.attachments", f"{role}: {on}", confidence, why)
        self.areas[muscle] = used

    def write(self, out: Path) -> Path:
        """Write the scene with all its files to a folder; return the scene.toml."""
        scale = 1.0 / MILLIMETRES[self.units]

        def written(file: str, surface: vtkPolyData) -> str:
            if file not in self.surfaces:
                write_polydata(out / file, with_points(surface, scale * points_of(surface)))
            return self.surfaces.get(file, file)

        text = [_HEADER]
        notes: dict[str, list[str]] = {}
        for guess in self.guesses:
            notes.setdefault(guess.what, []).append(f"# {guess}\n")

        def add(table: str, keys: Mapping[str, Any]) -> None:
            text.extend(["\n", *notes.pop(table, []), f"[{table}]\n"] if table else [])
            for key, value in keys.items():
                text.extend([*notes.pop(f"{table}.{key}".lstrip("."), []), f"{key} = {inline_toml(value)}\n"])

        add("", {"name": self.name, "units": self.units, "frame": self.frame})
        for name, bone in self.bones.items():
            add(f"bones.{name}", {"surface": written(f"bones/{name}.vtp", bone)})
        if self.model is not None:
            add("opensim", {"model": _seen_from(out, self.model), **self.opensim})
        for name, joint in ({} if self.model is not None else self.joints).items():
            centre = {"centre": [scale * value for value in joint["centre"]]} if "centre" in joint else {}
            add(f"joints.{name}", joint | centre)
        if self.sweep:
            add("motion", _motion(self.sweep, out / "motion.csv"))
        kept = ("units", "opensim.", *(f"joints.{name}." for name in self.joints))
        kept += tuple(f"muscles.{name}.surface" for name in self.muscles)
        sure: dict[str, float] = {}
        for what, confidence in ((guess.what, guess.confidence) for guess in self.guesses):
            if what.startswith(kept):
                sure[what] = min(confidence, sure.get(what, 1.0))
        add("guessed", {f'"{what}"': round(confidence, 4) for what, confidence in sure.items()})
        for name, muscle in self.muscles.items():
            areas = self.areas.get(name, [])
            areas = [replace(area, landmarks=scale * np.asarray(area.landmarks)) for area in areas]
            surface = {"surface": written(f"muscles/{name}.vtp", muscle)}
            tables = {"attachments": write_areas(out, name, areas, self.frame)} if areas else {}
            add(f"muscles.{name}", surface | tables | {"fibres": FIBRES})
        for name, muscle in self.loose.items():
            written(f"muscles/{name}.vtp", muscle)
        text += ["\n", *(f"# {what}: {note[2:]}" for what, lines in notes.items() for note in lines)]
        write_rows(out / "guesses.csv", table_of(self.guesses))
        write_rows(out / "volumes.csv", [VOLUMES, *self._volumes()])
        self.file, self.text = out / "scene.toml", "".join(text)
        write_text(self.file, self.text)
        return self.file

    def _volumes(self) -> Iterator[tuple[object, ...]]:
        kinds = (("bone", self.bones), ("muscle", self.muscles | self.loose))
        for kind, name, surface in ((kind, *item) for kind, each in kinds for item in each.items()):
            report = survey(*checked_surface(surface, name))
            own: list[object] = [""] * len(COLUMNS)
            if kind == "muscle" and report.closed:
                try:
                    own = architecture_row(name, surface, self.areas.get(name, ()))
                except ValueError as error:
                    own[0] = "; ".join(fault_of(error))
            yield name, kind, report.volume if report.closed else "", report.area, report.n_triangles, *own


def _motion(sweep: Mapping[str, tuple[float, float]], path: Path) -> dict[str, Any]:
    """Return a motion from first to last angles [degrees]: a grid of one or two coordinates.

    Further coordinates go to the last in turn, the one before back, in a file.
    """
    if len(sweep) < 3:
        steps = 12 if len(sweep) == 1 else 4
        return {"grid": {name: [*sorted(ends), np.ptp(ends) / steps] for name, ends in sweep.items()}}
    turns = np.arange(12 * len(sweep) + 1) / 12.0
    shares = (np.clip(1.0 - np.abs(turns - k), 0.0, 1.0) for k in range(1, len(sweep) + 1))
    columns = [low + (end - low) * share for (low, end), share in zip(sweep.values(), shares, strict=True)]
    write_rows(path, [["time", *sweep], *np.transpose([turns, *columns]).tolist()])
    return {"file": path.name}


#: Longest side of a surface [mm]: of an adult's femur; and below which the distances of guesses, found for
#: adults, scale, as for the bones of small animals, hands and feet.
HUMAN, SMALLEST = 400.0, 100.0
_AREA = re.compile(rf"^(.+)_({'|'.join((*ROLES, VIA))})(?:_(.*))?$")


def likely_unit(longest: float) -> tuple[str, float]:
    """Return the likely unit of a longest side, and the confidence."""
    if longest >= CHECKS["unit"]["shortest"]:
        return "mm", 0.9
    return ("m", 0.9) if MILLIMETRES["m"] * longest <= CHECKS["unit"]["longest"] else ("cm", 0.3)


def _longest(clouds: Mapping[str, Floats]) -> float:
    """Return the longest side of surfaces, points by file."""
    longest = max(map(longest_side, clouds.values()))
    if longest > CHECKS["unit"]["certain"]:
        raise InputError("", f"the longest side of all surfaces is {longest:.4g}", CHECKS["unit"]["do"])
    for where, problem, remedy, _ in other_units(clouds):
        raise InputError(where, problem, remedy)
    return longest


def draft_of_files(
    files: Sequence[Path], out: Path, stated: Mapping[str, str], frame: str, *, repair: bool
) -> Draft:
    """Return an incomplete scene of meshes and landmarks, as of :func:`~vtkmuscle.labels.init`.

    ``stated`` is ``"bone"`` or ``"muscle"`` by name. FileNotFoundError or ValueError if a file cannot be
    read, or its name is not recognised.
    """
    draft = Draft(out.resolve().name, frame=frame)
    landmarks, meshes, clouds = [], {}, {}
    for file in files:
        check_is_file(file)
        name = plain_name(_stem(file))
        if _AREA.match(_roles_name(file)):
            landmarks.append(file)
            continue
        kind = stated.get(name) or kind_of(name)
        fault = "unknown_name" if file.suffix.lower() in SURFACE_SUFFIXES else "no_surface"
        if kind is None or fault == "no_surface":
            raise InputError(file, *words_of(fault, suffixes=", ".join(SURFACE_SUFFIXES)))
        if name in meshes:
            raise InputError(file, f"another file has the name {name!r}", "remove or rename a file")
        if (header := stated_frame(file) or frame) != frame:
            problem = f"the header says {header}, but the frame is {frame}"
            raise InputError(file, problem, f"use --frame {header}")
        meshes[name] = kind, read_surface(file)
        clouds[str(file)] = points_of(meshes[name][1])
        confidence = 1.0 if name in stated else 0.8
        draft.guess(f"{kind}s.{name}", kind, confidence, f"a {kind} by its name, {file.name}")
        draft.surfaces[f"{kind}s/{name}.vtp"] = _seen_from(out, file)
    for name in sorted(stated.keys() - meshes):
        raise InputError(f"--{stated[name]}", f"no mesh has the name {name!r}", suggestion(name, meshes))
    if not meshes:
        raise InputError("", "there is no surface of a bone or a muscle", "give mesh files")
    longest = _longest(clouds)
    draft.units, confidence = likely_unit(longest)
    small = draft.units == "mm" and longest < SMALLEST
    why = f"the longest side of all surfaces is {longest:.4g}{', of an animal, or a person in cm' * small}"
    draft.guess("units", draft.units, 0.4 if small else confidence, why)
    scale = MILLIMETRES[draft.units]
    for name, (kind, mesh) in meshes.items():
        getattr(draft, f"{kind}s")[name] = with_points(mesh, scale * points_of(mesh))
    for name, muscle in list(draft.muscles.items()):
        try:
            mended, repairs = repaired_surface(muscle) if repair else (muscle, "")
            draft.muscles[name], turned = closed_surface(mended)
        except InputError as error:
            draft.leave_out(name, "; ".join(fault_of(error)))
            continue
        if repairs:
            del draft.surfaces[f"muscles/{name}.vtp"]  # so the mended surface is written
            draft.guess(f"muscles.{name}.surface", "repaired", 0.5, repairs)
        if turned:
            draft.guess(f"muscles.{name}.surface", "turned", 0.9, "inside out; a run turns its triangles")
    draft.scale = scale_of([*draft.bones.values(), *draft.muscles.values()])
    draft.within *= draft.scale
    add_landmarks(draft, landmarks, scale=scale)
    return draft


def _seen_from(folder: Path, file: Path) -> str:
    """Return the path of a file from a folder; .. leads up from a link's target."""
    return Path(relpath(file.parent.resolve(), folder.resolve()), file.name).as_posix()


def scale_of(surfaces: Iterable[vtkPolyData]) -> float:
    """Return the size of the animal with these surfaces [mm] against a human, at most 1."""
    sides = [longest_side(points_of(surface)) for surface in surfaces if surface.GetNumberOfPoints()]
    longest = max(sides, default=HUMAN)
    return 1.0 if longest >= SMALLEST else longest / HUMAN


def _stem(file: Path) -> str:
    """Return a file's name without the suffix; a name may have dots."""
    return file.stem.removesuffix(".mrk")


def _roles_name(file: Path) -> str:
    return "_".join(re.findall(r"[a-z0-9]+", _stem(file).casefold()))


def named_area(file: Path, muscles: Sequence[str]) -> tuple[str, str, str]:
    """Return the muscle and role in the name of a file of landmarks, and what follows, such as a bone."""
    match = _AREA.match(_roles_name(file))
    names = (plain_name(match[1]), f"{plain_name(match[1])}_{side_of(match[3] or '')}") if match else ()
    muscle = next((name for name in names if name in muscles), "")
    if match is None or not muscle:
        remedy = f"rename it MUSCLE_origin or MUSCLE_insertion, of {', '.join(muscles) or 'none'}"
        raise InputError(file, "the file name has no known muscle and role", remedy)
    return muscle, match[2], match[3] or ""


def add_landmarks(draft: Draft, files: Sequence[Path], *, scale: float = 1.0) -> None:
    """Add landmarks to a draft by file names: muscle, role, and possibly the bone after the role."""
    for file in files:
        muscle, role, further_name = named_area(file, [*draft.muscles, *draft.left_out])
        if muscle in draft.left_out:
            continue
        key = f"muscles.{muscle}.attachments"
        points, closed = read_landmarks(file, frame=draft.frame)
        points = scale * points
        sure = None
        named = [bone for bone in draft.bones if further_name and bone in plain_name(further_name)]
        bones = draft.candidate_bones(muscle).items()
        away = {name: solids_of(*checked_surface(bone, name)).distances(points) for name, bone in bones}
        gaps = {name: float(np.abs(distances).mean()) for name, distances in away.items()}
        if not named and not gaps:
            remedy = "give the mesh of a bone on its side, or leave the landmarks out"
            raise InputError(file, f"no bone can have the {role} of {muscle!r}", remedy)
        bone, *further = named or sorted(gaps, key=gaps.__getitem__)
        if not named:
            sure = 1.0 - min(1.0, gaps[bone] / gaps[further[0]]) if further else 1.0
            why = f"{role} on {bone!r}, {gaps[bone]:.1f} mm from the landmarks in {file.name}"
            draft.guess(key, f"{role}: {bone}", sure, why)
        if not closed and len(points) > 3:
            gap = float((sides := ring_sides(points))[-1] / max(sides.sum(), 1e-300))
            why = f"{role}: the gap from the last landmark to the first is {100.0 * gap:.0f} % of the ring"
            closed, likely = goes_round(points) or role == VIA, 2.0 * gap  # half of it for a straight line
            what = ("a ring", 1.0 - likely) if closed else ("an open curve", likely)
            draft.guess(key, *what, why)
        area = AttachmentArea(role, bone, points, closed, False, sure)
        size = longest_side(points_of(draft.muscles[muscle]))
        for _, problem, remedy, _ in disorder(key, area, size, "mm"):
            draft.guess(key, f"landmarks of {file.name}", 0.0, f"{role}: {problem}; {remedy}")
            area = replace(area, confidence=0.0)
        draft.areas.setdefault(muscle, []).append(area)
