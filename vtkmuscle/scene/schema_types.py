"""What the values in a scene file are: texts, names, triples, and one of some words."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, PlainValidator, StringConstraints, WithJsonSchema
from pydantic_core import CoreSchema
from pydantic_core.core_schema import no_info_plain_validator_function

from vtkmuscle.core.words import shown, suggestion
from vtkmuscle.scene.names import checked_name
from vtkmuscle.scene.settings import fault


def three(value: Any) -> list[float]:
    """Return three finite numbers; raise a fault where there are others."""
    good = isinstance(value, list | tuple) and len(value) == 3
    if not good or not all(
        isinstance(v, int | float) and not isinstance(v, bool) and finite(v) for v in value
    ):
        raise fault(f"must be 3 finite numbers, not {shown(value)}", "")
    return [float(v) for v in value]


def finite(value: float) -> bool:
    """Return whether a number is finite."""
    try:
        return isfinite(value)
    except OverflowError:  # an integer that no float is as large as
        return False


def direction(axis: list[float]) -> list[float]:
    """Return a direction; raise a fault where it has no length."""
    if not any(axis):
        raise fault("has no length", "write axis = [1.0, 0.0, 0.0], or another direction")
    return axis


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


Text = Annotated[str, StringConstraints(min_length=1)]
Name = Annotated[Text, AfterValidator(checked_name)]
Triple = Annotated[
    list[float],
    PlainValidator(three),
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}),
]


class Table(BaseModel):
    """A table of a scene file: strict in its types, and without unknown keys."""

    model_config = ConfigDict(extra="forbid", strict=True)
