"""What the values in a scene file are: texts, names, triples, one of some words, and settings of filters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import partial
from math import isfinite
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PlainValidator,
    StringConstraints,
    create_model,
)
from pydantic_core import CoreSchema, PydanticCustomError
from pydantic_core.core_schema import no_info_plain_validator_function

from vtkmuscle.core.words import quoted, suggestion
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.pipelines import FIBRE_SETTINGS, TRANSPORT_SETTINGS


def fault(problem: str, remedy: str) -> PydanticCustomError:
    """Return the error that a validator raises, with the fields of a SceneError."""
    return PydanticCustomError("fault", "{problem}", {"problem": problem, "remedy": remedy})


class Settings(BaseModel):
    """A table of settings, of which only those that are given count."""

    model_config = ConfigDict(extra="forbid")
    #: Settings that there were once, and what to do without each.
    gone: ClassVar[Mapping[str, str]] = {}

    def given(self) -> dict[str, Any]:
        """Return the settings that the table has."""
        return {
            name: getattr(self, name) for name in type(self).model_fields if name in self.model_fields_set
        }


def _checked(declaration: Parameter[Any], value: Any) -> Any:
    try:
        declaration.check(value, "")
    except ValueError:
        problem = f"{quoted(value)} is not allowed"
        raise fault(problem, f"it must be {declaration.allowed}") from None
    return value


def _settings(name: str, declarations: Mapping[str, Parameter[Any]], doc: str) -> type[Settings]:
    fields: dict[str, Any] = {}
    for word, declaration in declarations.items():
        kind = Annotated[Any, PlainValidator(partial(_checked, declaration))]
        fields[word] = (kind, Field(None))
    return create_model(name, __base__=Settings, __doc__=doc, **fields)


if TYPE_CHECKING:
    Solver = Settings
    Fixing = Settings
    Fibres = Settings
else:
    Solver = _settings("Solver", PBDDeformer.parameter_declarations, "Those of PBDDeformer.")
    Solver.gone = PBDDeformer.gone
    Fixing = _settings("Fixing", FixedPointDetector.parameter_declarations, "Those of FixedPointDetector.")
    Fibres = _settings(
        "Fibres",
        FIBRE_SETTINGS | TRANSPORT_SETTINGS,
        "Settings of a muscle's fibres: those of vtkmuscle.pipelines.decompose, and weight_tolerance of "
        "FibreTransport.",
    )


#: Letters, digits, and a few signs that every file system takes.
_NAME = re.compile(r"\w[\w .+-]*(?<![ .])")

#: Files of these names cannot be made on Windows, whatever their suffix.
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)

#: A folder of such a name might be where a file of results goes, or the other way round.
_RESULTS = (".pvd", ".vtkhdf", ".vtp", ".csv", ".json", ".png", ".toml", ".html", ".partial")

#: Bytes of a name: file systems take 255, of which the parts that are added need some.
_LONGEST = 150


def is_finite(value: Any) -> bool:
    """Return whether a value is a finite number; true and false are none."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and isfinite(value)
    except OverflowError:  # an integer that no float is as large as
        return False


def direction(axis: list[float]) -> list[float]:
    """Return a direction; raise a fault where it has no length."""
    if not any(axis):
        raise fault("has no length", "write axis = [1.0, 0.0, 0.0], or another direction")
    return axis


def checked_name(name: str) -> str:
    """Return a name of a scene, a bone or a muscle; raise a fault where no file could be called so."""
    if not _NAME.fullmatch(name):
        remedy = "use letters, digits, spaces and _ - + . only, beginning and ending with a letter or digit"
        raise fault(f"{quoted(name)} cannot be part of a file name", remedy)
    if _DEVICES.fullmatch(name):
        raise fault(f"{name!r} cannot be the name of a file on Windows", "give it another name")
    if name.casefold().endswith(_RESULTS):
        problem = f"{quoted(name)} ends like a file of results, and would be in the way of one"
        raise fault(problem, "leave out the suffix")
    if len(name.encode()) > _LONGEST:
        raise fault(f"a name of {len(name)} letters is too long for a file", f"use at most {_LONGEST}")
    return name


class OneOf:
    """Marks a text that is one of some words; ``what`` is what each of them is."""

    def __init__(self, words: Iterable[str], what: str = "") -> None:
        self.words, self.what = list(words), what

    def __get_pydantic_core_schema__(self, *_: Any) -> CoreSchema:
        return no_info_plain_validator_function(self._check)

    def _check(self, value: Any) -> str:
        if not isinstance(value, str) or not value:
            raise fault(f"must be a text, not {quoted(value)}", "")
        if value not in self.words:
            what = (
                f"there is no {self.what} {quoted(value)}" if self.what else f"{quoted(value)} is not allowed"
            )
            raise fault(what, suggestion(value, self.words))
        return value


class FiniteNumbers:
    """Marks a list of finite numbers, one or more, or so many; ``what`` is what it must be."""

    def __init__(self, count: int | None = None, what: str = "a list of finite numbers") -> None:
        self.count, self.what = count, what

    def __get_pydantic_core_schema__(self, *_: Any) -> CoreSchema:
        return no_info_plain_validator_function(self.check)

    def check(self, value: Any) -> list[float]:
        """Return the numbers; raise a fault where there are others."""
        good = isinstance(value, list | tuple) and len(value) > 0 and all(map(is_finite, value))
        if not good or len(value) != (self.count or len(value)):
            raise fault(f"must be {self.what}, not {quoted(value)}", "")
        return [float(one) for one in value]


Text = Annotated[str, StringConstraints(min_length=1)]
Name = Annotated[Text, AfterValidator(checked_name)]
Triple = Annotated[list[float], FiniteNumbers(3, "3 finite numbers")]


class Table(BaseModel):
    """A table of a scene file: strict in its types, and without unknown keys."""

    model_config = ConfigDict(extra="forbid", strict=True)
