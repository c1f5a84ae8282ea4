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
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.path_deformer import PathDeformer
from vtkmuscle.filters.pbd_deformer import PBDDeformer
from vtkmuscle.filters.taut_paths import TautPaths
from vtkmuscle.pipelines import FIBRE_SETTINGS, TRANSPORT_SETTINGS


class SchemaTable(BaseModel):
    """A table of a scene file, with strict types."""

    model_config = ConfigDict(extra="forbid", defer_build=True, strict=True, use_attribute_docstrings=True)


def key(example: Any = None, default: Any = None) -> Any:
    """Return a table's key with example and default."""
    return Field(default, examples=None if example is None else [example])


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

    x: _Numbers = key([0.0, 60.0, 120.0], ...)
    """Values of the coordinate, ascending."""
    y: _Numbers = key([0.0, 2.0, 5.0], ...)
    """Values of the function at each x."""


class Function(SchemaTable):
    """A function of a coordinate, by a single key."""

    polynomial: _Numbers | None = key([0.5, 0.0])
    """Coefficients of a polynomial, highest power first: [0.5, 0] is half the coordinate."""
    spline: KnotsTable | None = None
    """A cubic spline through knots { x = [...], y = [...] }, straight beyond the knots: OpenSim's
    SimmSpline."""


class JointCoordinateTable(Function):
    """A coordinate of a joint; with a function it follows another coordinate."""

    range: _Range | None = key([0.0, 120.0])
    """Least and largest value; a motion beyond gives a warning."""
    rest: FiniteFloat = key(0.0, 0.0)
    """Value in the rest pose."""
    positive: Text | None = key("flexion")
    """The positive direction, in words."""
    follows: Text | None = key("knee_angle")
    """The independent coordinate, e.g. the knee's for a patella; polynomial or spline gives the function."""


class Axis(Function):
    """A rotation or a translation of a custom joint."""

    axis: Direction = key([1.0, 0.0, 0.0], ...)
    """Direction, of any length; rotations are right-handed."""
    coordinate: Text = key("knee_angle", ...)
    """The independent coordinate."""


_Axes = Annotated[list[Axis], Field(max_length=3)]


class JointTable(SchemaTable):
    """A joint between two bones."""

    parent: Text = key("femur", ...)
    """The fixed bone of the joint."""
    child: Text = key("tibia", ...)
    """The moving bone. A bone is the child of at most one joint; a bone without a joint does not move. A body
    between two joints need not be a bone of the scene."""
    type: Annotated[str, OneOf(JOINT_KINDS)] = key("pin", ...)
    """pin turns about an axis; ball about three axes, each carried by earlier axes; weld does not move;
    custom has rotations and translations."""
    centre: Triple | None = key([0.0, 0.0, 0.0])
    """A point on the axes, in the rest pose; translations are relative to the point. Optional for a weld."""
    axis: Direction | None = key([1.0, 0.0, 0.0])
    """Axis of a pin; positive angles are right-handed."""
    axes: Annotated[list[Direction], Field(min_length=3, max_length=3)] | None = key(
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    )
    """Axes of a ball at coordinates of 0: the first carries the second, both carry the third. Default: x, y
    and z."""
    coordinates: Annotated[dict[str, JointCoordinateTable], BeforeValidator(names_or_tables)] | None = key(
        ["knee_angle"]
    )
    """Names of the coordinates: a name for a pin, three for a ball; or a table of coordinates. Angles are in
    degrees, translations in the scene's unit."""
    rotations: _Axes | None = None
    """Of a custom joint, three at most, each carried by earlier rotations: { axis = [0, 0, 1], coordinate =
    'knee_angle', polynomial = [1.0, 0.0] }. Without a function, the angle is the coordinate [degrees]."""
    translations: _Axes | None = None
    """Of a custom joint, along axes of the parent, three at most, in the form of rotations [the scene's
    unit]."""


class OpenSimTable(SchemaTable):
    """An OpenSim model with the scene's joints."""

    model: Text = key("leg.osim", ...)
    """An .osim file of version 3 or 4; OpenSim is not needed."""
    bodies: dict[str, Text] | None = None
    """The body of each bone, { femur = 'femur_r' }. Default: the body with the bone's name."""
    frame: Text | None = key("pelvis")
    """The body with the scene's frame, in the rest pose. Default: the ground."""
    fixed: Text | None = key("pelvis")
    """The fixed body; motion is relative to the fixed body. Default: the ground."""
    rest: dict[str, FiniteFloat] | None = None
    """Coordinates in the rest pose, { hip_flexion_r = 1.576 }, in degrees or metres. Default: the model's
    default values."""


class Hill(SchemaTable):
    """Hill's parameters of a muscle, for exports; a run uses two lengths for its architecture."""

    optimal_fibre_length: Positive | None = key(110.0)
    """Fibre length of largest force, in ``units``."""
    tendon_slack_length: Positive | None = key(310.0)
    """Length of the tendon without force, in ``units``."""
    sarcomere_length: Positive | None = key(2.6)
    """Mean length of the sarcomeres in the rest pose, always in micrometres."""
    pennation: Annotated[FiniteFloat, Field(ge=0.0, lt=90.0)] | None = key(12.0)
    """Angle of the fibres to the tendon at the optimal length, in degrees."""
    max_isometric_force: Positive | None = key(1100.0)
    """Greatest force, in newtons. Or give ``pcsa`` and ``specific_tension``."""
    pcsa: Positive | None = key(18.0)
    """Physiological cross-sectional area, always in cm^2."""
    specific_tension: Positive | None = key(61.0)
    """Force per area, in N/cm^2; there is no default."""

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
