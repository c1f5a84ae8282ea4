"""A study: its subjects, and the work that is to be done for each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Self

from pydantic import ValidationError
from pydantic_core import PydanticCustomError

from vtkmuscle.cohort.schema import Compare, Sensitivity, StudyTable
from vtkmuscle.cohort.template import filled, laid_over
from vtkmuscle.core.errors import InputError, fault_of
from vtkmuscle.core.words import suggestion
from vtkmuscle.io.csv_table import filled_rows
from vtkmuscle.scene.faults import Faults, SceneError
from vtkmuscle.scene.files import parsed
from vtkmuscle.scene.names import checked_name
from vtkmuscle.scene.validation import faults_in_words
from vtkmuscle.sensitivity import CAUSES

#: The columns of a table of subjects that mean something to a study.
ID, FOLDER = "id", "folder"
#: What a study is compared by where it is not a column.
BY_SETTING = "setting"
#: The motion of a study that names none, as in the template.
ONLY = "motion"
#: More subjects than this are a slip.
_MOST_SUBJECTS = 100_000


@dataclass(frozen=True)
class Task:
    """One muscle of one subject in one motion: what a worker is given.

    Attributes
    ----------
    subject, motion, setting, sample, muscle : str
        Which; setting and sample may be "". A sample is a cause and a number, as ``"axis 3"``.
    scene_file : str
        The scene's file; paths in it are relative to its folder.
    values : mapping
        What is in it, filled in.
    problem : str
        Why it cannot be done at all, where that is known; "" else.
    frames : str or None
        Which frames.
    groups : int
        Of fibres.
    pictures : bool
        Whether it is drawn.
    amount : float
        By how much the sample's cause is varied.
    seed : int
        Of the samples.
    """

    subject: str
    motion: str
    setting: str
    sample: str
    muscle: str
    scene_file: str
    values: Mapping[str, Any]
    problem: str = ""
    frames: str | None = None
    groups: int = 1
    pictures: bool = True
    amount: float = 0.0
    seed: int = 0

    @property
    def name(self) -> str:
        """Name of the part that it makes; no two tasks of a study have the same."""
        parts = self.subject, self.motion, self.setting, self.sample.replace(" ", "_"), self.muscle
        return "/".join(part or "-" for part in parts)


@dataclass(frozen=True, eq=False)
class Study:
    """Subjects, and what is done for each.

    Attributes
    ----------
    name : str
        Of the study.
    file : Path
        The STUDY.toml.
    subjects : tuple of dict
        The rows of the table of subjects: texts by column, ``id`` and others.
    table : StudyTable
        What is in the STUDY.toml.
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
            With file, key, problem and remedy for all that is wrong in the study. What is wrong with a single
            subject's files does not stop a study.
        """
        file = Path(path)
        try:
            table = StudyTable.model_validate(parsed(file))
        except ValidationError as error:
            found = faults_in_words(error.errors(include_url=False), StudyTable)
            Faults(SceneError(problem, key, remedy, file) for key, problem, remedy in found).raise_any()
            raise
        subjects = _subjects(file, file.parent / table.subjects)
        study = cls(table.name or file.stem, file, subjects, table)
        study._check()
        return study

    @property
    def settings(self) -> Mapping[str, Mapping[str, Any]]:
        """Tables that are laid over the scene, by name; one empty one where there are none."""
        return self.table.settings or {"": {}}

    @property
    def sensitivity(self) -> Sensitivity | None:
        """What is varied."""
        return self.table.sensitivity

    @property
    def compare(self) -> Compare | None:
        """What is compared."""
        return self.table.compare

    @property
    def samples(self) -> Iterator[tuple[str, float]]:
        """Give the samples and by how much each is varied; the first one, "", not at all."""
        yield "", 0.0
        if self.sensitivity is not None:
            for cause in CAUSES:
                amount = getattr(self.sensitivity, cause)
                if amount > 0.0:
                    for number in range(self.sensitivity.samples):
                        yield f"{cause} {number + 1}", amount

    def tasks(self) -> Iterator[list[Task]]:
        """Give the tasks, those together that share a scene: its surfaces and distances from bones."""
        for row in self.subjects:
            for motion in self.table.motions or {ONLY: {}}:
                for setting, changes in self.settings.items():
                    for sample, amount in self.samples:
                        yield list(self._tasks(row, motion, setting, changes, sample, amount))

    def _tasks(
        self,
        row: Mapping[str, str],
        motion: str,
        setting: str,
        changes: Mapping[str, Any],
        sample: str,
        amount: float,
    ) -> Iterator[Task]:
        values: dict[str, Any] = {}
        problem, scene_file = "", ""
        muscles: Sequence[str] = self.table.muscles or ()
        try:
            values, template = self._values(row, motion, changes)
            scene_file = str(template)
            muscles = _muscles(values, muscles, template)
        except (ValueError, OSError) as error:
            problem = "; ".join(part for part in (str(error).splitlines()[0],) if part)
        for muscle in muscles or ("",):
            yield Task(
                *(row[ID], motion, setting, sample, muscle, scene_file, values, problem),
                frames=self.table.frames,
                groups=self.table.groups,
                pictures=self.table.pictures and not sample,
                amount=amount,
                seed=0 if self.sensitivity is None else self.sensitivity.seed,
            )

    def _values(
        self, row: Mapping[str, str], motion: str, changes: Mapping[str, Any]
    ) -> tuple[dict[str, Any], Path]:
        """Return what is in the scene's file, filled in, and the file."""
        template = self.file.parent / filled(self.table.scene, row, self.file, "scene")
        values = filled(parsed(template), row, template)
        if motion in self.table.motions:
            values["motion"] = filled(self.table.motions[motion], row, self.file, f"motions.{motion}")
        return laid_over(values, filled(dict(changes), row, self.file, "settings")), template.absolute()

    def _check(self) -> None:
        """Raise an error for keys that do not agree with each other or with the table of subjects."""
        columns = list(self.subjects[0])
        if (compare := self.compare) is None:
            return
        if compare.by == BY_SETTING:
            if len(self.table.settings) != 2:
                problem = f"compares settings, of which there are {len(self.table.settings)}"
                raise SceneError(problem, "compare.by", "add two tables [settings.NAME]", self.file)
            return
        for key, column in (("by", compare.by), ("pair", compare.pair)):
            if column is not None and column not in columns:
                problem = f"the table of subjects has no column {column!r}"
                raise SceneError(problem, f"compare.{key}", suggestion(column, columns), self.file)
        groups = sorted({row[compare.by] for row in self.subjects})
        if len(groups) != 2:
            shown = ", ".join(map(repr, groups[:5]))
            problem = f"column {compare.by!r} has {len(groups)} different values ({shown}), not 2"
            raise SceneError(problem, "compare.by", "name a column that has two", self.file)


def _muscles(values: Mapping[str, Any], wanted: Sequence[str], file: Path) -> Sequence[str]:
    found = values.get("muscles")
    if not isinstance(found, dict) or not found:
        raise SceneError("the scene has no muscles", "muscles", "add a table [muscles.NAME]", file)
    for name in (*found, *wanted):
        try:
            checked_name(name)
        except PydanticCustomError as error:
            context = error.context or {}
            problem, remedy = str(context.get("problem")), str(context.get("remedy"))
            raise SceneError(problem, "muscles", remedy, file) from None
    for name in wanted:
        if name not in found:
            raise SceneError(f"there is no muscle {name!r}", "muscles", suggestion(name, found), file)
    return wanted or list(found)


def _subjects(study: Path, path: Path) -> tuple[Mapping[str, str], ...]:
    """Return the rows of a table of subjects, each with an id of its own."""
    try:
        rows = filled_rows(path, _MOST_SUBJECTS)
    except (ValueError, OSError) as error:
        problem, remedy = fault_of(error)
        raise SceneError(problem, "subjects", remedy, path) from error
    if len(rows) < 2:
        raise InputError(path, "the table has no subject", "write a line of columns and a line per subject")
    _, columns = rows[0]
    for column in columns:
        if not column or columns.count(column) > 1:
            problem = f"there are two columns {column!r}" if column else "a column has no name"
            raise InputError(path, problem, "give each a name of its own")
    if ID not in columns:
        raise InputError(path, f"the table has no column {ID!r}", f"it has: {', '.join(columns)}")
    subjects: dict[str, Mapping[str, str]] = {}
    for line, cells in rows[1:]:
        if len(cells) != len(columns):
            problem = f"line {line} has {len(cells)} cells, but there are {len(columns)} columns"
            raise InputError(path, problem, "correct that line")
        row = dict(zip(columns, cells, strict=True))
        try:
            name = checked_name(row[ID])
        except PydanticCustomError as error:
            context = error.context or {}
            raise InputError(
                path, f"line {line}: the id {context.get('problem')}", str(context.get("remedy"))
            ) from None
        if name.casefold() in subjects:
            problem = f"line {line}: the id {name!r} stands in the table twice"
            raise InputError(path, problem, "give each subject an id of its own")
        if row.get(FOLDER):
            row[FOLDER] = str((path.parent / row[FOLDER]).absolute())
        subjects[name.casefold()] = row
    return tuple(subjects.values())
