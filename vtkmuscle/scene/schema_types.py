"""What the values in a scene file are: texts, names, triples, and one of some words."""

from __future__ import annotations

import re
from collections.abc import Iterable
from math import isfinite
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, StringConstraints
from pydantic_core import CoreSchema
from pydantic_core.core_schema import no_info_plain_validator_function

from vtkmuscle.core.words import shown, suggestion
from vtkmuscle.scene.settings import fault

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
        raise fault(f"{shown(name)} cannot be part of a file name", remedy)
    if _DEVICES.fullmatch(name):
        raise fault(f"{name!r} cannot be the name of a file on Windows", "give it another name")
    if name.casefold().endswith(_RESULTS):
        problem = f"{shown(name)} ends like a file of results, and would be in the way of one"
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

    def __get_pydantic_json_schema__(self, *_: Any) -> dict[str, Any]:
        return {"enum": self.words}

    def _check(self, value: Any) -> str:
        if not isinstance(value, str) or not value:
            raise fault(f"must be a text, not {shown(value)}", "")
        if value not in self.words:
            what = (
                f"there is no {self.what} {shown(value)}" if self.what else f"{shown(value)} is not allowed"
            )
            raise fault(what, suggestion(value, self.words))
        return value


class FiniteNumbers:
    """Marks a list of finite numbers, one or more, or so many; ``what`` is what it must be."""

    def __init__(self, count: int | None = None, what: str = "a list of finite numbers") -> None:
        self.count, self.what = count, what

    def __get_pydantic_core_schema__(self, *_: Any) -> CoreSchema:
        return no_info_plain_validator_function(self.check)

    def __get_pydantic_json_schema__(self, *_: Any) -> dict[str, Any]:
        most = {} if self.count is None else {"maxItems": self.count}
        return {"type": "array", "items": {"type": "number"}, "minItems": self.count or 1, **most}

    def check(self, value: Any) -> list[float]:
        """Return the numbers; raise a fault where there are others."""
        good = isinstance(value, list | tuple) and len(value) > 0 and all(map(is_finite, value))
        if not good or len(value) != (self.count or len(value)):
            raise fault(f"must be {self.what}, not {shown(value)}", "")
        return [float(one) for one in value]


Text = Annotated[str, StringConstraints(min_length=1)]
Name = Annotated[Text, AfterValidator(checked_name)]
Triple = Annotated[list[float], FiniteNumbers(3, "3 finite numbers")]


class Table(BaseModel):
    """A table of a scene file: strict in its types, and without unknown keys."""

    model_config = ConfigDict(extra="forbid", strict=True)
