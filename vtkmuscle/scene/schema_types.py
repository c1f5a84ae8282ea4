"""Value types of a scene file: texts, names, numbers, choices, filter settings."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    PlainValidator,
    StringConstraints,
    create_model,
)
from pydantic_core import CoreSchema
from pydantic_core.core_schema import literal_schema

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import quoted
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.path_deformer import PathDeformer
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.filters.taut_paths import TautPaths
from vtkmuscle.pipelines import FIBRE_SETTINGS, TRANSPORT_SETTINGS


class SchemaTable(BaseModel):
    """A table of a scene file, with strict types."""

    model_config = ConfigDict(extra="forbid", strict=True, use_attribute_docstrings=True)


def key(example: Any = None, default: Any = None) -> Any:
    """Return a table's key with example and default."""
    return Field(default, examples=None if example is None else [example])


class Settings(BaseModel):
    """A table of filter settings; only keys in the file count."""

    model_config = ConfigDict(extra="forbid")

    def given(self) -> dict[str, Any]:
        """Return the settings in the file."""
        return {
            name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set
        }


def _checked(declaration: Parameter[Any], value: Any) -> Any:
    try:
        declaration.check(value, "")
    except ValueError:
        raise InputError("", f"{quoted(value)} is not allowed", f"it must be {declaration.allowed}") from None
    return value


def _settings(name: str, declarations: Mapping[str, Parameter[Any]]) -> type[Settings]:
    fields: dict[str, Any] = {
        word: (Annotated[Any, PlainValidator(partial(_checked, declaration))], None)
        for word, declaration in declarations.items()
    }
    return create_model(name, __base__=Settings, **fields)


if TYPE_CHECKING:
    Solver = Settings
    Fixing = Settings
    Fibres = Settings
    Paths = Settings
else:
    Paths = _settings("Paths", TautPaths.parameter_declarations)
    Solver = _settings("Solver", PathDeformer.parameter_declarations | PBDDeformer.parameter_declarations)
    Fixing = _settings("Fixing", FixedPointDetector.parameter_declarations)
    Fibres = _settings("Fibres", FIBRE_SETTINGS | TRANSPORT_SETTINGS)


#: Letters, digits, and signs allowed by every file system.
_NAME = re.compile(r"\w[\w .+-]*(?<![ .])")
#: Device names of Windows, forbidden with any suffix.
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
#: Suffixes of results: a folder with such a name could collide with a file.
_RESULTS = (".pvd", ".vtkhdf", ".vtp", ".csv", ".json", ".png", ".toml", ".html", ".partial")
#: Bytes of a name: file systems allow 255 with suffixes.
_LONGEST = 150


def checked_name(name: str) -> str:
    """Return a name usable as a file name; InputError otherwise."""
    if not _NAME.fullmatch(name):
        remedy = "use only letters, digits, spaces and _ - + .; begin and end with a letter or digit"
        raise InputError("", f"{quoted(name)} cannot be part of a file name", remedy)
    if _DEVICES.fullmatch(name):
        raise InputError("", f"Windows allows no file of the name {name!r}", "give it another name")
    if name.casefold().endswith(_RESULTS):
        raise InputError("", f"the name {quoted(name)} ends like a file of results", "leave out the suffix")
    if len(name.encode()) > _LONGEST:
        remedy = f"use at most {_LONGEST} bytes"
        raise InputError("", f"a name of {len(name)} letters is too long for a file", remedy)
    return name


def _direction(axis: list[float]) -> list[float]:
    if not any(axis):
        raise InputError("", "the direction has no length", "write axis = [1.0, 0.0, 0.0], for example")
    return axis


class OneOf:
    """A text limited to some words."""

    def __init__(self, words: Iterable[str]) -> None:
        self.words = list(words)

    def __get_pydantic_core_schema__(self, *_: Any) -> CoreSchema:
        return literal_schema(self.words)


Text = Annotated[str, StringConstraints(min_length=1)]
Name = Annotated[Text, AfterValidator(checked_name)]
Positive = Annotated[FiniteFloat, Field(gt=0.0)]
Triple = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
Direction = Annotated[Triple, AfterValidator(_direction)]
