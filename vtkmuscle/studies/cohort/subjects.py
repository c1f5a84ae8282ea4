"""A study: its subjects, the scene of each filled in from their table, and its cases."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import chain, product
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, ValidationError

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import suggestion
from vtkmuscle.io.csv_table import number_in, table_rows
from vtkmuscle.scene.faults import Faults, SceneError, errors_at
from vtkmuscle.scene.files import parsed
from vtkmuscle.scene.schema_types import Name, Table, Text, checked_name
from vtkmuscle.scene.validation import faults_in_words
from vtkmuscle.studies.case import Case, SceneText
from vtkmuscle.studies.variation import AS_IT_IS, CAUSES, Variation, samples_of

_Amount = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


def _key(default: Any, example: Any, description: str) -> Any:
    """Return a key of a table; the default of a required one is ``...``."""
    return Field(default, examples=[example], description=description)


class Sensitivity(Table):
    """Inputs that are moved at random, one cause at a time, and how far."""

    samples: Annotated[int, Field(ge=3, le=10_000)] = _key(8, 20, "Runs for each cause, 3 or more.")
    seed: Annotated[int, Field(ge=0)] = _key(0, 1, "The same again for the same seed.")
    landmarks: _Amount = _key(
        0.0, 5.0, "Each area is moved as a whole by this distance [mm], in any direction."
    )
    axis: _Amount = _key(0.0, 3.0, "The motion's axes are tilted by this angle [degrees], all alike.")
    centre: _Amount = _key(0.0, 3.0, "The motion's axes are shifted by this distance [mm], all alike.")
    segmentation: _Amount = _key(0.0, 1.0, "Standard deviation of smooth waves of all surfaces [mm].")


class StudyTable(Table):
    """A study for vtkmuscle: subjects by a table, a template scene, motions."""

    name: Name | None = _key(None, "hips", "Name of the study. Without it that of the file.")
    subjects: Text = _key(
        ...,
        "subjects.csv",
        "A CSV table with a row per subject and a column id; all its columns are variables. A column folder "
        "is taken relative to the table's own folder.",
    )
    scene: Text = _key(
        ...,
        "template.toml",
        "A scene.toml in which {COLUMN} stands for the text in that column of the subject's row, and a value "
        "'{COLUMN:number}' for a number. A value that is '{COLUMN}' alone is left out where the cell is "
        "empty. Or '{folder}/scene.toml', a scene for each subject.",
    )
    frames: Text | None = _key(None, "0:31", "Frames to keep, as of vtkmuscle run. Without it all.")
    muscles: Annotated[list[Text], Field(min_length=1)] | None = _key(
        None, ["iliacus"], "Which muscles; without it all of the scene."
    )
    groups: Annotated[int, Field(ge=1, le=1000)] = _key(
        1, 3, "Groups of fibres that lengthen alike, a row each; 1 for their mean."
    )
    motions: dict[Name, dict[str, Any]] = _key(
        {}, {}, "Tables [motions.NAME], each a [motion] of a scene, in place of the template's."
    )
    settings: dict[Name, dict[str, Any]] = _key(
        {}, {}, "Tables [settings.NAME] of keys of a scene, laid over it: every subject is run with each."
    )
    sensitivity: Sensitivity | None = _key(None, {}, "Runs every subject again with inputs moved at random.")


#: A variable: the name of a column, and whether its cells are numbers.
_VARIABLE = re.compile(r"\{([^{}:]+)(:number)?\}")


def filled(value: Any, row: Mapping[str, str], file: Path, key: str = "") -> Any:
    """Return a value of a template, or a table of values, with a subject's variables filled in.

    ``{COLUMN}`` stands for the text in that column, and the value ``{COLUMN:number}`` for a number. A value
    that is ``{COLUMN}`` alone is left out if the cell is empty: it becomes None.

    Raises
    ------
    SceneError
        If there is no such column, or a cell is no number; with file and key.

    Examples
    --------
    >>> from pathlib import Path
    >>> from vtkmuscle.studies.cohort.subjects import filled
    >>> row = {"side": "left", "turn": "", "x": "1.5"}
    >>> filled({"a": "femur_{side}.stl", "b": "{turn}", "c": ["{x:number}", 0]}, row, Path("t.toml"))
    {'a': 'femur_left.stl', 'c': [1.5, 0]}
    """
    if isinstance(value, Mapping):
        parts = {name: filled(one, row, file, f"{key}.{name}".lstrip(".")) for name, one in value.items()}
        return {name: one for name, one in parts.items() if one is not None}
    if isinstance(value, list):
        listed = [filled(one, row, file, f"{key}[{number}]") for number, one in enumerate(value)]
        return [one for one in listed if one is not None]
    if not isinstance(value, str):
        return value
    alone = _VARIABLE.fullmatch(value)
    if alone is None:
        return _VARIABLE.sub(lambda match: _cell(match, row, file, key), value)
    cell = _cell(alone, row, file, key)
    if not cell:
        return None
    return _number(cell, alone[1], file, key) if alone[2] else cell


def _cell(match: re.Match[str], row: Mapping[str, str], file: Path, key: str) -> str:
    if match[1] not in row:
        problem = f"{match[0]} is no variable: the table of subjects has no column {match[1]!r}"
        raise SceneError(problem, key, suggestion(match[1], row), file)
    return row[match[1]]


def _number(cell: str, column: str, file: Path, key: str) -> float:
    try:
        number = float(cell)
        return int(number) if number == int(number) and "." not in cell else number
    except (ValueError, OverflowError):  # text, NaN, or infinity
        problem = f"column {column!r} of subjects has {cell[:60]!r}, but must be a finite number"
        raise SceneError(problem, key, "correct the table of subjects", file) from None


def laid_over(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table in which the values of another replace those of the same keys, at any depth."""
    merged = dict(values)
    for name, one in changes.items():
        before = merged.get(name)
        merged[name] = laid_over(before, one) if isinstance(before, dict) and isinstance(one, dict) else one
    return merged


#: Columns of a table of subjects with a meaning of their own.
ID, FOLDER = "id", "folder"
#: Name of the only motion of a study without ``[motions]``.
ONLY = "motion"
#: A table with more subjects is taken for a mistake.
_MOST_SUBJECTS = 100_000


@dataclass(frozen=True, eq=False)
class Study:
    """Subjects, and the runs of each.

    Attributes
    ----------
    name : str
    file : Path
        The STUDY.toml.
    subjects : tuple of dict
        The rows of the table of subjects: texts by column, ``id`` and others.
    table : StudyTable
        The content of the STUDY.toml.
    """

    name: str
    file: Path
    subjects: tuple[Mapping[str, str], ...]
    table: StudyTable

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """Read a STUDY.toml and its table of subjects, and check every key.

        Raises
        ------
        ValueError
            With file, key, problem and remedy of each fault in the study. A fault in one subject's files does
            not stop the study.
        """
        file = Path(path)
        try:
            table = StudyTable.model_validate(parsed(file))
        except ValidationError as error:
            found = faults_in_words(error.errors(include_url=False), StudyTable)
            Faults(SceneError(problem, key, remedy, file) for key, problem, remedy in found).raise_any()
            raise
        subjects = _subjects(file, file.parent / table.subjects)
        return cls(table.name or file.stem, file, subjects, table)

    @property
    def columns(self) -> dict[str, type]:
        """Type of the other columns of the table of subjects: float if all cells are numbers, else str."""
        names = [name for name in self.subjects[0] if name not in (ID, FOLDER)]
        texts = {name: [row[name] for row in self.subjects if row[name]] for name in names}
        return {
            name: float if np.isfinite([*map(number_in, found)]).all() else str
            for name, found in texts.items()
        }

    def variations(self) -> list[Variation]:
        """Return the variation that changes nothing, then the samples of all causes."""
        asked = self.table.sensitivity
        if asked is None:
            return [AS_IT_IS]
        amounts = {cause: getattr(asked, cause) for cause in CAUSES if getattr(asked, cause) > 0.0}
        moved = (samples_of(cause, one, asked.samples, asked.seed) for cause, one in amounts.items())
        return [AS_IT_IS, *chain.from_iterable(moved)]

    def cases(self) -> list[list[Case]]:
        """Return the cases in groups that share a scene."""
        table, motions, settings = self.table, self.table.motions or [ONLY], self.table.settings or [""]
        cases = []
        for row, motion, setting in product(self.subjects, motions, settings):
            scene, problem, muscles = SceneText("", {}), "", table.muscles or [""]
            try:
                scene = self._scene(row, motion, table.settings.get(setting, {}))
                muscles = _muscles(scene, table.muscles or [])
            except (ValueError, OSError) as error:
                problem = str(error).splitlines()[0]
            for variation in self.variations():
                labels = {"subject": row[ID], "motion": motion, "setting": setting, "sample": variation.name}
                whole = Case(labels, "", scene, variation, table.frames, table.groups, problem)
                cases.append([replace(whole, muscle=muscle) for muscle in muscles])
        return cases

    def _scene(self, row: Mapping[str, str], motion: str, changes: Mapping[str, Any]) -> SceneText:
        """Return the scene of a subject, filled in."""
        template = self.file.parent / (filled(self.table.scene, row, self.file, "scene") or "")
        values = filled(parsed(template), row, template)
        if motion in self.table.motions:
            values["motion"] = filled(self.table.motions[motion], row, self.file, f"motions.{motion}")
        values = laid_over(values, filled(dict(changes), row, self.file, "settings"))
        return SceneText(str(template.absolute()), values)


def _muscles(scene: SceneText, wanted: list[str]) -> list[str]:
    found, file = scene.values.get("muscles"), Path(scene.file)
    if not isinstance(found, dict) or not found:
        raise SceneError("the scene has no muscles", "muscles", "add a table [muscles.NAME]", file)
    for name in (*found, *wanted):
        _check_name(name, file, f"muscles: the name {name!r}")
    for name in wanted:
        if name not in found:
            raise SceneError(f"there is no muscle {name!r}", "muscles", suggestion(name, found), file)
    return wanted or list(found)


def _check_name(name: str, file: Path, what: str) -> None:
    """Raise an InputError for a name that cannot be part of a file name."""
    try:
        checked_name(name)
    except InputError as error:
        raise InputError(file, f"{what} {error.problem}", error.remedy) from None


def _subjects(study: Path, path: Path) -> tuple[Mapping[str, str], ...]:
    """Return the rows of a table of subjects, each with an id of its own."""
    remedy = "write a line of columns and a line per subject"
    with errors_at("subjects", path):
        rows = table_rows(path, needed=[ID], most=_MOST_SUBJECTS, remedy=remedy)
    subjects: dict[str, Mapping[str, str]] = {}
    for line, row in rows:
        name = row[ID]
        _check_name(name, path, f"line {line}: the id")
        if name.casefold() in subjects:
            problem = f"line {line}: the id {name!r} stands in the table twice"
            raise InputError(path, problem, "give each subject an id of its own")
        if row.get(FOLDER):
            row[FOLDER] = str((path.parent / row[FOLDER]).absolute())
        subjects[name.casefold()] = row
    return tuple(subjects.values())
