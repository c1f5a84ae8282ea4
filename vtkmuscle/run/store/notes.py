"""Notes on finished muscles and runs.

A folder of results has a note per finished muscle and a note of the finished run.
"""

from __future__ import annotations

import json
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, PlainSerializer, PlainValidator, ValidationError

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats
from vtkmuscle.io.digests import plain
from vtkmuscle.io.writing import write_text
from vtkmuscle.run.frames import RUN_AGAIN

#: Number of the schema. It grows by 1 with each change of a class below, so that no other schema is read.
FORMAT = 2


def _array(value: Any) -> Floats:
    if value is None or isinstance(value, dict):
        raise ValueError("this is no array")
    try:
        return np.array(value, dtype=np.float64)
    except TypeError as error:
        raise ValueError(str(error)) from error


def _inside(name: str) -> str:
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts:
        raise ValueError("this file is outside of the folder of results")
    return name


Array = Annotated[Any, PlainValidator(_array), PlainSerializer(lambda array: np.asarray(array).tolist())]
#: Sizes of files [bytes] by their paths in the folder.
Sizes = dict[Annotated[str, AfterValidator(_inside)], int]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", from_attributes=True)


class CoordinateNote(_Table):
    """Fields of a :class:`~vtkmuscle.core.motion.coordinates.Coordinate`."""

    values: Array
    unit: str
    positive: str
    twists: dict[str, Array] | None


class MotionNote(_Table):
    """Fields of a :class:`~vtkmuscle.RigidMotion`."""

    times: Array
    transforms: dict[str, Array]
    centre: dict[str, Array] | Array | None
    coordinates: dict[str, CoordinateNote]


class CurveNote(_Table):
    """Fields of a :class:`~vtkmuscle.io.LiteratureCurve`."""

    source: str
    muscle: str
    dof: str
    part: str
    angles: Array
    arms: Array


class MuscleNote(_Table):
    """The note of a finished muscle.

    A digest of the input, the part of the report, lengths per frame, and the files.
    """

    format: int = FORMAT
    key: str
    report: dict[str, Any]
    has_fibres: bool
    lengths: Array
    fibre_lengths: Array
    length_errors: Array
    fibre_length_errors: Array
    files: Sizes


class RunNote(_Table):
    """The note of a finished run.

    The digest of the report, and the parts of a result other than muscles.
    """

    format: int = FORMAT
    report: str
    bones: list[str]
    motion: MotionNote
    literature: dict[str, list[CurveNote]]
    crosses: dict[str, list[str]]
    files: Sizes


Note = TypeVar("Note", MuscleNote, RunNote)


def read_note(path: Path, kind: type[Note]) -> Note:
    """Return the note in a file.

    Raises
    ------
    InputError
        If the file is missing, damaged, or of a different version of vtkmuscle.
    """
    try:
        values = json.loads(path.read_text(encoding="utf-8"))
        if isinstance(values, dict) and values.get("format") != FORMAT:
            problem = f"another version of vtkmuscle has written this note (its format is not {FORMAT})"
            raise InputError(path, problem, RUN_AGAIN)
        return kind.model_validate(values)
    except FileNotFoundError:
        raise InputError(path, "the file is missing", RUN_AGAIN) from None
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, RecursionError, ValidationError) as error:
        raise InputError(path, "the file is damaged", RUN_AGAIN) from error


def write_note(path: Path, note: BaseModel) -> None:
    """Write a note, all or nothing."""
    write_text(path, json.dumps(note.model_dump(), default=plain) + "\n")
