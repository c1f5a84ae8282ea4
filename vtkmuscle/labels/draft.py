"""Draft of a scene from surfaces and landmarks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError, fault_of
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.data.attachments import ROLES, AttachmentArea
from vtkmuscle.filters.attachment_estimator import NEAR, estimated_areas
from vtkmuscle.io.csv_table import write_rows
from vtkmuscle.io.writing import write_polydata, write_text
from vtkmuscle.labels.guesses import LEFT_OUT, Guess, table_of
from vtkmuscle.labels.joints import bodies_of, guessed_joints, moving_chain
from vtkmuscle.labels.names import side_of
from vtkmuscle.scene.data import MILLIMETRES
from vtkmuscle.scene.writing import inline_toml, write_areas

#: Fibres of each muscle.
FIBRES = {"template": "parallel", "n_fibres": 100, "resolution": 15}
_HEADER = """# Drafted by vtkmuscle. Missing information was guessed: the comment above a guess has the reason
# and a confidence from 0 to 1; guesses.csv lists all guesses. Paths are relative to this file.
"""
#: Highest confidence of an estimated area: the measured overlap with a digitised area on the same bone, see
#: vtkmuscle.core.attachments.contacts.
OVERLAP = 0.64
#: Remedy for a muscle that touches fewer than two bones.
GIVE = "give landmarks of the area: a file MUSCLE_origin or MUSCLE_insertion, as .csv, .mrk.json or .vtp"


@dataclass
class Draft:
    """A scene in preparation, in mm.

    Attributes
    ----------
    name : str
        Name of the scene.
    bones, muscles : dict of str to vtkPolyData
        Surfaces at rest.
    areas : dict of str to list of AttachmentArea
        By muscle: areas from landmarks, later with estimated areas.
    frame, units : str
        Frame of the surfaces, and unit of the written scene.
    surfaces : dict of str to str
        Existing surface files, relative to the scene; missing files are written.
    within : float
        Largest distance between a muscle and a bone in contact [mm].
    guesses : list of Guess
        All guesses.
    left_out : dict of str to str
        Reasons, by muscle that cannot be made.
    joints, sweep : dict
        As of :func:`~vtkmuscle.labels.joints.guessed_joints`.
    """

    name: str
    bones: dict[str, vtkPolyData] = field(default_factory=dict)
    muscles: dict[str, vtkPolyData] = field(default_factory=dict)
    areas: dict[str, list[AttachmentArea]] = field(default_factory=dict)
    frame: str = "LPS"
    units: str = "mm"
    surfaces: dict[str, str] = field(default_factory=dict)
    within: float = NEAR
    guesses: list[Guess] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    joints: dict[str, dict[str, Any]] = field(default_factory=dict)
    sweep: dict[str, float] = field(default_factory=dict)

    def complete(self) -> None:
        """Guess joints and missing areas; leave out muscles without areas.

        Raises
        ------
        ValueError
            If there are no joints, or no muscle remains, with the reasons.
        """
        self.joints, self.sweep, guesses = guessed_joints(self.bones, frame=self.frame)
        self.guesses += guesses
        if not self.sweep:
            bones = f"the bones are {', '.join(self.bones) or 'none'}"
            why = "; ".join(guess.why for guess in guesses) or bones
            remedy = "name bones by their anatomy, such as femur_r and pelvis"
            raise InputError(self.name, f"no joint was found between the bones: {why}", remedy)
        for muscle in list(self.muscles):
            try:
                self._attach(muscle)
            except ValueError as error:
                self.leave_out(muscle, "; ".join(part for part in fault_of(error) if part))
        if not self.muscles:
            problem = "; ".join(f"{muscle}: {why}" for muscle, why in self.left_out.items())
            raise InputError(self.name, f"no muscle can be made: {problem or 'there is none'}", GIVE)

    def leave_out(self, muscle: str, why: str) -> None:
        """Remove a muscle from the scene, and note the reason."""
        self.left_out[muscle] = why
        self.muscles.pop(muscle, None)
        self.guesses.append(Guess(f"muscles.{muscle}", LEFT_OUT, 0.0, why))

    def candidate_bones(self, muscle: str) -> dict[str, vtkPolyData]:
        """Return the bones on a muscle's side of the body."""
        sides = {side_of(muscle), None} if side_of(muscle) else {"left", "right", None}
        return {name: bone for name, bone in self.bones.items() if side_of(name) in sides}

    def _attach(self, muscle: str) -> None:
        """Estimate the areas of a muscle without landmarks."""
        digitised = self.areas.get(muscle, [])
        named = {area.role: area.bone for area in digitised if area.role in ROLES}
        missing = [role for role in ROLES if role not in named]
        if not missing:
            return
        bones = self.candidate_bones(muscle)
        bodies = bodies_of(bones, self.joints)
        groups = [[bone for bone in bones if bodies[bone] == body] for body in dict.fromkeys(bodies.values())]
        areas = estimated_areas(self.muscles[muscle], bones, within=self.within, bodies=groups, **named)
        depth = {area.role: len(moving_chain(area.bone, self.joints)) for area in areas}
        if not named and depth["origin"] > depth["insertion"]:
            areas = [replace(area, role=ROLES[area.role == ROLES[0]]) for area in areas]
        used = [*digitised, *(area for area in areas if area.role in missing)]
        if len({bodies[area.bone] for area in used}) < 2:
            rigid = " and ".join(sorted({area.bone for area in used}))
            raise InputError("", f"both ends are on the same moving body: {rigid}", GIVE)
        for role in missing:
            ends = [area for area in areas if area.role == role]
            on = ", ".join(dict.fromkeys(area.bone for area in ends))
            confidence = OVERLAP * min(area.confidence or 0.0 for area in ends)
            why = f"{role} on {on}, in contact with the muscle's end"
            self.guesses.append(Guess(f"muscles.{muscle}.attachments", f"{role}: {on}", confidence, why))
        self.areas[muscle] = used

    def write(self, out: Path) -> Path:
        """Write the scene to a folder; return the scene.toml.

        The folder also gets surfaces, landmarks, the motion and guesses.csv.
        """
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
        for name, joint in self.joints.items():
            centre = {"centre": [scale * value for value in joint["centre"]]} if "centre" in joint else {}
            add(f"joints.{name}", joint | centre)
        add("motion", {"file": "motion.sto"})
        for name, muscle in self.muscles.items():
            areas = [replace(area, landmarks=scale * np.asarray(area.landmarks)) for area in self.areas[name]]
            tables = write_areas(out, name, areas)
            surface = written(f"muscles/{name}.vtp", muscle)
            add(f"muscles.{name}", {"surface": surface, "attachments": tables, "fibres": FIBRES})
        text += ["\n", *(f"# {what}: {note[2:]}" for what, lines in notes.items() for note in lines)]
        write_rows(out / "guesses.csv", table_of(self.guesses))
        write_text(out / "motion.sto", _sweep(self.sweep))
        write_text(out / "scene.toml", "".join(text))
        return out / "scene.toml"


def _sweep(limits: Mapping[str, float]) -> str:
    """Return a motion from rest to the largest angles [degrees]."""
    part = np.linspace(0.0, 1.0, 13)
    longest = max(limits.values())
    columns = [longest * part, *(angle * part for angle in limits.values())]
    rows = ["\t".join(f"{value:g}" for value in row) for row in np.transpose(columns)]
    head = ["sweep", "inDegrees=yes", f"nRows={len(rows)}", f"nColumns={len(columns)}", "endheader"]
    return "\n".join([*head, "\t".join(["time", *limits]), *rows]) + "\n"
