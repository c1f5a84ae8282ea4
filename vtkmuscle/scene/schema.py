"""Tables of a scene file as pydantic models, used by :mod:`vtkmuscle.scene.validation`."""

import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import pydantic
from pydantic import AfterValidator, BeforeValidator, Field, PositiveFloat, WrapValidator
from pydantic_core.core_schema import literal_schema

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.coordinates import ANGLES, MILLIMETRES
from vtkmuscle.core.types import ROUNDING
from vtkmuscle.core.words import quoted, suggestion
from vtkmuscle.data import toml_table
from vtkmuscle.data.attachments import ROLES, VIA
from vtkmuscle.filters.base.parameters import Parameter
from vtkmuscle.filters.fixed_point_detector import FixedPointDetector
from vtkmuscle.filters.taut_paths import TautPaths
from vtkmuscle.io.landmarks import FRAMES
from vtkmuscle.io.motion_table import MOST_FRAMES
from vtkmuscle.pipelines import DEFORMER_SETTINGS, DEFORMERS, FIBRE_SETTINGS, QUALITIES, TRANSPORT_SETTINGS
from vtkmuscle.scene.data import words_of

#: Text in place of attachments, for estimates.
ESTIMATE = "estimate"
#: Bone of a single table of transforms; the key ``bone`` has the name.
ALONE = ""
#: By table and key of a scene file: meaning, and an example.
_KEYS = toml_table("vtkmuscle.scene", "keys.toml")


class SchemaTable(pydantic.BaseModel):
    """A table of a scene file, with strict types. Meanings of keys are in keys.toml."""

    model_config = pydantic.ConfigDict(extra="forbid", defer_build=True, strict=True, allow_inf_nan=False)

    @classmethod
    def __pydantic_init_subclass__(cls, **_: Any) -> None:
        for name, (meaning, *examples) in _KEYS.get(cls.__name__, {}).items():
            cls.model_fields[name].description = meaning
            cls.model_fields[name].examples = examples


class Settings(SchemaTable):
    """A table of filter settings; only keys in the file count."""

    def settings(self) -> dict[str, Any]:
        """Return the settings in the file."""
        return self.model_dump(exclude_unset=True)


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
        word: (Annotated[Any, pydantic.PlainValidator(partial(_checked, declaration))], None)
        for word, declaration in declarations.items()
    }
    return pydantic.create_model(name, __base__=Settings, **fields)


if TYPE_CHECKING:
    Solver = Settings
    Fixing = Settings
    Fibres = Settings
    Paths = Settings
else:
    Paths = _settings("Paths", TautPaths.parameter_declarations)
    Solver = _settings("Solver", DEFORMER_SETTINGS["paths"] | DEFORMER_SETTINGS["pbd"])
    Fixing = _settings("Fixing", FixedPointDetector.parameter_declarations)
    Fibres = _settings("Fibres", FIBRE_SETTINGS | TRANSPORT_SETTINGS)


#: Letters, digits, and signs allowed by every file system.
_NAME = re.compile(r"\w[\w .+-]*(?<![ .])")
#: Suffixes of results: a folder with such a name could collide with a file.
_RESULTS = (".pvd", ".vtp", ".csv", ".json", ".png", ".toml", ".html", ".partial")


def checked_name(name: str) -> str:
    """Return a name usable as a file name; InputError otherwise."""
    if not _NAME.fullmatch(name):
        raise InputError("", *words_of("no_file_name", name=quoted(name)))
    if name.casefold().endswith(_RESULTS):
        raise InputError("", *words_of("results_name", name=quoted(name)))
    return name


def _direction(axis: list[float]) -> list[float]:
    if not any(axis):
        raise InputError("", *words_of("no_direction"))
    return axis


def one_of(words: Iterable[str]) -> pydantic.GetPydanticSchema:
    """Return the schema of a text limited to some words."""
    return pydantic.GetPydanticSchema(lambda *_: literal_schema(list(words)))


Text = Annotated[str, Field(min_length=1)]
Name = Annotated[Text, AfterValidator(checked_name)]
Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
Direction = Annotated[Triple, AfterValidator(_direction)]


JOINT_KINDS, MOTION_KINDS = _KEYS["joint_kinds"], _KEYS["motion_kinds"]


def _ascending(ends: list[float]) -> list[float]:
    if ends[0] >= ends[1]:
        raise InputError("", f"must be a least and a largest value, not {quoted(ends)}")
    return ends


def names_or_tables(value: Any) -> Any:
    """Return a list of names as a mapping to empty tables."""
    if isinstance(value, list) and all(isinstance(name, str) and name for name in value):
        return {name: {} for name in value}
    if not isinstance(value, dict):
        raise InputError("", *words_of("no_names", value=quoted(value)))
    return value


_Numbers = Annotated[list[float], Field(min_length=1)]
_Range = Annotated[list[float], Field(min_length=2, max_length=2), AfterValidator(_ascending)]


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
    rest: float = 0.0
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
    type: Annotated[str, one_of(JOINT_KINDS)]
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
    rest: dict[str, float] | None = None


class Hill(SchemaTable):
    """Hill's parameters of a muscle, for exports. A run uses two lengths for its architecture."""

    optimal_fibre_length: PositiveFloat | None = None
    tendon_slack_length: PositiveFloat | None = None
    sarcomere_length: PositiveFloat | None = None
    pennation: Annotated[float, Field(ge=0.0, lt=90.0)] | None = None
    max_isometric_force: PositiveFloat | None = None
    pcsa: PositiveFloat | None = None
    specific_tension: PositiveFloat | None = None

    @pydantic.model_validator(mode="after")
    def _check(self) -> "Hill":
        parts = [name for name in ("pcsa", "specific_tension") if getattr(self, name) is not None]
        if len(parts) == 1:
            raise InputError("", *words_of("no_force", part=parts[0]))
        if parts and self.max_isometric_force is not None:
            raise InputError("", *words_of("two_forces"))
        return self


def _steps(values: list[float]) -> list[float]:
    if len(values) != 3:
        raise InputError("", f"must be start, stop and step, not {quoted(values)}", "write [0, 90, 5]")
    start, stop, step = values
    # A step longer than the range: these are three values.
    if not (step > 0 and (stop == start or stop - start >= (1.0 - ROUNDING) * step)):
        raise InputError("", *words_of("descends", start=start, stop=stop, step=step))
    if (stop - start) / step > MOST_FRAMES:
        raise InputError("", *words_of("many_frames", count=(stop - start) / step))
    return values


def _by_bone(value: Any) -> Any:
    return value if isinstance(value, dict) else {ALONE: value}


def _list_or_estimate(value: Any, handler: Callable[[Any], Any]) -> Any:
    if value == ESTIMATE:
        return Estimate()
    if isinstance(value, dict):
        named = value.get(ESTIMATE)
        bones = [bone for bone in named if isinstance(bone, str)] if isinstance(named, list) else []
        if len(bones) != 2 or named != bones or len(value) > 1:
            raise InputError("", *words_of("no_two_bones", value=quoted(value)))
        return Estimate(*bones)
    if not isinstance(value, list):
        raise InputError("", *words_of("no_areas", value=quoted(value)))
    return handler(value)


_Steps = Annotated[list[float], AfterValidator(_steps)]
_Confidence = Annotated[float, Field(ge=0.0, le=1.0)]
_Texts = Annotated[list[Text], BeforeValidator(lambda value: [value] if isinstance(value, str) else value)]


class BoneTable(SchemaTable):
    """A bone."""

    surface: Text


class ColumnTable(SchemaTable):
    """A column of a table of transforms that is a joint coordinate."""

    unit: Annotated[str, one_of((*ANGLES, *MILLIMETRES))] = "deg"
    positive: Text | None = None


class Hinge(SchemaTable):
    """A bone that turns about an axis."""

    bone: Text
    centre: Triple
    axis: Direction
    angles: _Steps
    coordinate: Text | None = None


class Motion(SchemaTable):
    """How the bones move: coordinates of joints, a table of transforms, or a hinge."""

    file: Text | None = None
    every: Annotated[int, Field(ge=1)] = 1
    grid: Annotated[dict[str, _Steps], Field(min_length=1)] | None = None
    bone: Text | None = None
    transforms: Annotated[dict[str, Text], BeforeValidator(_by_bone), Field(min_length=1)] | None = None
    time: Text | None = None
    centre: Annotated[dict[str, Triple], BeforeValidator(_by_bone)] | None = None
    coordinates: Annotated[dict[str, ColumnTable], BeforeValidator(names_or_tables)] | None = None
    hinge: Hinge | None = None


class Area(SchemaTable):
    """An attachment area of a muscle, or a via ring."""

    role: Annotated[str, one_of((*ROLES, VIA))]
    bone: Text
    landmarks: Text
    closed: bool | None = None
    estimated: bool = False
    confidence: _Confidence | None = None


class Estimate(list[Area]):
    """Attachments to be estimated, with both bones named, origin first, or none."""

    def __init__(self, *bones: str) -> None:
        super().__init__()
        self.bones = bones


class Aponeuroses(SchemaTable):
    """End surfaces of a muscle's fibres, in place of the attachment areas."""

    proximal: Annotated[_Texts, Field(min_length=1)]
    distal: Annotated[_Texts, Field(min_length=1)]


class MuscleTable(SchemaTable):
    """A muscle."""

    surface: Text
    attachments: Annotated[list[Area], WrapValidator(_list_or_estimate)] = Field(default_factory=list)
    aponeuroses: Aponeuroses | None = None
    fibres: Fibres | None = None
    superficial_fibres: Text | None = None
    solver: Solver = Field(default_factory=Solver)
    fixing: Fixing = Field(default_factory=Fixing)
    literature: Text | None = None
    crosses: list[Text] | None = None
    hill: Hill | None = None
    muscle: Text | None = None


class SceneTable(SchemaTable):
    """A scene for vtkmuscle: bones, muscles and a motion."""

    name: Name | None = None
    units: Annotated[str, one_of(MILLIMETRES)] = "mm"
    deformer: Annotated[str, one_of(DEFORMERS)] = "paths"
    quality: Annotated[str, one_of(QUALITIES)] | None = None
    muscle_contact: Annotated[str, one_of(("off", "on", "measure"))] = "off"
    bones: dict[Name, BoneTable]
    motion: Motion
    joints: dict[str, JointTable] = Field(default_factory=dict)
    opensim: OpenSimTable | None = None
    frame: Annotated[str, one_of(FRAMES)] = "LPS"
    guessed: dict[str, _Confidence] = Field(default_factory=dict)
    mirror: Annotated[str, one_of("xyz")] | None = None
    muscles: dict[Name, MuscleTable]
    paths: Paths | None = None
    solver: Solver = Field(default_factory=Solver)
    fixing: Fixing = Field(default_factory=Fixing)
