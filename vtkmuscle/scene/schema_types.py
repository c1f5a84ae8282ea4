"""Value types of a scene file, and its tables of settings, joints and Hill's parameters."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    FiniteFloat,
    PlainValidator,
    StringConstraints,
    create_model,
    model_validator,
)
from pydantic_core import CoreSchema
from pydantic_core.core_schema import literal_schema

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import quoted, suggestion
from vtkmuscle.data import toml_table
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.path_deformer import PathDeformer
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.filters.taut_paths import TautPaths
from vtkmuscle.pipelines import FIBRE_SETTINGS, TRANSPORT_SETTINGS

#: By table and key of a scene file: meaning, and an example.
_KEYS = toml_table("vtkmuscle.scene", "keys.toml")


class SchemaTable(BaseModel):
    """A table of a scene file, with strict types; keys.toml has the meanings of keys."""

    model_config = ConfigDict(extra="forbid", defer_build=True, strict=True)

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        for name, (meaning, *examples) in _KEYS.get(cls.__name__, {}).items():
            cls.model_fields[name].description = meaning
            cls.model_fields[name].examples = examples


class Settings(BaseModel):
    """A table of filter settings; only keys in the file count."""

    model_config = ConfigDict(extra="forbid", defer_build=True)

    def given(self) -> dict[str, Any]:
        """Return the settings in the file."""
        present = self.model_fields_set
        return {name: getattr(self, name) for name in type(self).model_fields if name in present}


def _checked(declaration: Parameter[Any], value: Any) -> Any:
    try:
        declaration.check(value, "")
    except ValueError:
        choices, allowed = declaration.choices, f"allowed: {declaration.allowed}"
        remedy = suggestion(value, choices) if choices and isinstance(value, str) else allowed
        raise InputError("", f"{quoted(value)} is not allowed", remedy) from None
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
#: Suffixes of results: a folder with such a name could collide with a file.
_RESULTS = (".pvd", ".vtp", ".csv", ".json", ".png", ".toml", ".html", ".partial")


def checked_name(name: str) -> str:
    """Return a name usable as a file name; InputError otherwise."""
    if not _NAME.fullmatch(name):
        remedy = "use only letters, digits, spaces and _ - + .; begin and end with a letter or digit"
        raise InputError("", f"{quoted(name)} cannot be part of a file name", remedy)
    if name.casefold().endswith(_RESULTS):
        raise InputError("", f"the name {quoted(name)} ends like a file of results", "leave out the suffix")
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


#: Number of coordinates of each kind of joint, None for any, and its required and optional keys.
JOINT_KINDS: dict[str, tuple[int | None, tuple[str, ...], tuple[str, ...]]] = {
    "pin": (1, ("centre", "axis"), ("coordinates",)),
    "ball": (3, ("centre",), ("axes", "coordinates")),
    "weld": (0, (), ("centre",)),
    "custom": (None, ("centre",), ("coordinates", "rotations", "translations")),
}


def _ascending(ends: list[float]) -> list[float]:
    if ends[0] >= ends[1]:
        raise InputError("", f"must be a least and a largest value, not {quoted(ends)}")
    return ends


def names_or_tables(value: Any) -> Any:
    """Return a list of names as a mapping to empty tables."""
    if isinstance(value, list) and all(isinstance(name, str) and name for name in value):
        return {name: {} for name in value}
    if not isinstance(value, dict):
        remedy = 'write ["NAME"], or { NAME = { positive = "flexion" } }'
        raise InputError("", f"must be a list of names, not {quoted(value)}", remedy)
    return value


_Numbers = Annotated[list[FiniteFloat], Field(min_length=1)]
_Range = Annotated[list[FiniteFloat], Field(min_length=2, max_length=2), AfterValidator(_ascending)]


class KnotsTable(SchemaTable):
    """Knots of a function."""

    x: _Numbers
    y: _Numbers


class Function(SchemaTable):
    """A function of a coordinate, by a single key."""

    polynomial: _Numbers | None = None
    spline: KnotsTable | None = None


class JointCoordinateTable(Function):
    """A coordinate of a joint; with a function it follows another coordinate."""

    range: _Range | None = None
    rest: FiniteFloat = 0.0
    positive: Text | None = None
    follows: Text | None = None


class Axis(Function):
    """A rotation or a translation of a custom joint."""

    axis: Direction
    coordinate: Text


_Axes = Annotated[list[Axis], Field(max_length=3)]


class JointTable(SchemaTable):
    """A joint between two bones."""

    parent: Text
    child: Text
    type: Annotated[str, OneOf(JOINT_KINDS)]
    centre: Triple | None = None
    axis: Direction | None = None
    axes: Annotated[list[Direction], Field(min_length=3, max_length=3)] | None = None
    coordinates: Annotated[dict[str, JointCoordinateTable], BeforeValidator(names_or_tables)] | None = None
    rotations: _Axes | None = None
    translations: _Axes | None = None


class OpenSimTable(SchemaTable):
    """An OpenSim model with the scene's joints."""

    model: Text
    bodies: dict[str, Text] | None = None
    frame: Text | None = None
    fixed: Text | None = None
    rest: dict[str, FiniteFloat] | None = None


class Hill(SchemaTable):
    """Hill's parameters of a muscle, for exports; a run uses two lengths for its architecture."""

    optimal_fibre_length: Positive | None = None
    tendon_slack_length: Positive | None = None
    sarcomere_length: Positive | None = None
    pennation: Annotated[FiniteFloat, Field(ge=0.0, lt=90.0)] | None = None
    max_isometric_force: Positive | None = None
    pcsa: Positive | None = None
    specific_tension: Positive | None = None

    @model_validator(mode="after")
    def _check(self) -> Hill:
        parts = [name for name in ("pcsa", "specific_tension") if getattr(self, name) is not None]
        if len(parts) == 1:
            remedy = "give pcsa and specific_tension, or max_isometric_force"
            raise InputError("", f"{parts[0]} alone gives no force", remedy)
        if parts and self.max_isometric_force is not None:
            problem = "max_isometric_force cannot be combined with pcsa and specific_tension"
            raise InputError("", problem, "give either")
        return self
