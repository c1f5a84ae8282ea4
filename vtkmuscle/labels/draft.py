"""A draft of a scene from surfaces and landmarks, with all guesses; written as a scene.toml."""

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
from vtkmuscle.data.estimated_areas import NEAR, estimated_areas
from vtkmuscle.io.csv_table import write_rows
from vtkmuscle.io.writing import write_polydata, write_text
from vtkmuscle.labels.guesses import LEFT_OUT, Guess, table_of
from vtkmuscle.labels.joints import bodies_of, depth_of, guessed_joints
from vtkmuscle.labels.names import side_of
from vtkmuscle.scene.data import MILLIMETRES
from vtkmuscle.scene.writing import inline_toml, write_areas

#: Poses of the sweep beside the first.
STEPS = 12
#: Fibres of each muscle.
FIBRES = {"template": "parallel", "n_fibres": 100, "resolution": 15}
_HEADER = """# Drafted by vtkmuscle. Missing information was guessed: each guess has a comment above it, with
# its sureness, from 0 to 1; guesses.csv lists them. Paths are relative to this file.
"""
#: Greatest sureness of an estimated area: its overlap with one digitised by hand, on the right bone (see
#: vtkmuscle.core.attachments.contacts).
OVERLAP = 0.64
#: What to do about a muscle that touches fewer than two bones.
GIVE = "give landmarks of the area: a file MUSCLE_origin or MUSCLE_insertion, as .csv, .mrk.json or .vtp"


@dataclass
class Draft:
    """A scene in preparation; lengths in mm.

    Attributes
    ----------
    name : str
        Of the scene.
    bones, muscles : dict of str to vtkPolyData
        Surfaces at rest.
    areas : dict of str to list of AttachmentArea
        By muscle: those of the user's landmarks; the others are estimated.
    frame, units : str
        The frame of the surfaces, and the unit that the scene is written in.
    surfaces : dict of str to str
        Files of surfaces that exist, relative to the scene's; the others are written.
    within : float
        A muscle that is no farther from a bone touches it [mm].
    guesses : list of Guess
        All guesses.
    left_out : dict of str to str
        Muscles that cannot be made, and why.
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
        """Guess the joints and the missing areas; leave out muscles without areas.

        Raises
        ------
        ValueError
            If there are no joints, or no muscle is left, with the reasons.
        """
        self.joints, self.sweep, guesses = guessed_joints(self.bones, frame=self.frame)
        self.guesses += guesses
        if not self.sweep:
            why = "; ".join(one.why for one in guesses) or f"the bones are {', '.join(self.bones) or 'none'}"
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
        """Take a muscle out of the scene, and note why."""
        self.left_out[muscle] = why
        self.muscles.pop(muscle, None)
        self.guesses.append(Guess(f"muscles.{muscle}", LEFT_OUT, 0.0, why))

    def bones_beside(self, muscle: str) -> dict[str, vtkPolyData]:
        """Return the bones that a muscle may be attached to: not those of the other side."""
        sides = {side_of(muscle), None} if side_of(muscle) else {"left", "right", None}
        return {name: bone for name, bone in self.bones.items() if side_of(name) in sides}

    def _attach(self, muscle: str) -> None:
        """Estimate the areas of a muscle that have no landmarks."""
        given = self.areas.get(muscle, [])
        missing = [role for role in ROLES if role not in {area.role for area in given}]
        if not missing:
            return
        bones = self.bones_beside(muscle)
        bodies = bodies_of(bones, self.joints)
        groups = [[bone for bone in bones if bodies[bone] == body] for body in dict.fromkeys(bodies.values())]
        named = {area.role: area.bone for area in given if area.role in ROLES}
        surface = self.muscles[muscle]
        areas = estimated_areas(surface, bones, within=self.within, bodies=groups, **named)
        depth = {area.role: depth_of(area.bone, self.joints) for area in areas}
        if not named and depth["origin"] > depth["insertion"]:
            areas = [replace(area, role=ROLES[area.role == ROLES[0]]) for area in areas]
        used = [*given, *(area for area in areas if area.role in missing)]
        if len({bodies[area.bone] for area in used}) < 2:
            on = " and ".join(sorted({area.bone for area in used}))
            raise InputError("", f"both ends are on what moves as one: {on}", GIVE)
        for role in missing:
            ends = [area for area in areas if area.role == role]
            on = ", ".join(dict.fromkeys(area.bone for area in ends))
            sure = OVERLAP * min(area.sureness or 0.0 for area in ends)
            why = f"{role} on {on}, where the muscle's end touches it"
            self.guesses.append(Guess(f"muscles.{muscle}.attachments", f"{role}: {on}", sure, why))
        self.areas[muscle] = used

    def write(self, out: Path) -> Path:
        """Write the scene, its files and the table of guesses to a folder; return the scene.toml."""
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
            areas = [replace(one, landmarks=scale * np.asarray(one.landmarks)) for one in self.areas[name]]
            tables = write_areas(out, name, areas)
            surface = written(f"muscles/{name}.vtp", muscle)
            add(f"muscles.{name}", {"surface": surface, "attachments": tables, "fibres": FIBRES})
        text += ["\n", *(f"# {what}: {note[2:]}" for what, found in notes.items() for note in found)]
        write_rows(out / "guesses.csv", table_of(self.guesses))
        write_text(out / "motion.sto", _sweep(self.sweep))
        write_text(out / "scene.toml", "".join(text))
        return out / "scene.toml"


def _sweep(most: Mapping[str, float]) -> str:
    """Return the motion: all coordinates together, from rest to the end of each [degrees]."""
    part = np.linspace(0.0, 1.0, STEPS + 1)
    longest = max(most.values())
    columns = [longest * part, *(angle * part for angle in most.values())]
    rows = ["\t".join(f"{value:g}" for value in row) for row in np.transpose(columns)]
    head = ["sweep", "inDegrees=yes", f"nRows={len(rows)}", f"nColumns={len(columns)}", "endheader"]
    return "\n".join([*head, "\t".join(["time", *most]), *rows]) + "\n"
