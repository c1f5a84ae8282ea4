"""Tables of a scene file as pydantic models, used by :mod:`vtkmuscle.scene.validation`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, WrapValidator

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.motion.coordinates import ANGLES, TRANSLATIONS
from vtkmuscle.core.words import quoted
from vtkmuscle.data.attachments import ROLES, VIA
from vtkmuscle.io.landmarks import FRAMES
from vtkmuscle.pipelines import DEFORMERS, QUALITIES
from vtkmuscle.scene.data import MILLIMETRES
from vtkmuscle.scene.schema_types import (
    Direction,
    Fibres,
    Fixing,
    Hill,
    JointTable,
    Name,
    OneOf,
    OpenSimTable,
    Paths,
    SchemaTable,
    Solver,
    Text,
    Triple,
    names_or_tables,
)

#: Text in place of attachments, for estimates.
ESTIMATE = "estimate"
#: Bone of a single table of transforms; the key ``bone`` has the name.
ALONE = ""
#: Largest number of frames of a motion; more indicate a wrong step.
MOST_FRAMES = 10_000


def _steps(values: list[float]) -> list[float]:
    start, stop, step = values
    if not (step > 0 and stop >= start):
        remedy = "write [start, stop, step] with step > 0 and stop >= start; to turn backwards, negate axis"
        raise InputError("", f"[{start:g}, {stop:g}, {step:g}] does not ascend", remedy)
    if (stop - start) / step > MOST_FRAMES:
        raise InputError("", f"{(stop - start) / step:.3g} frames are too many", "choose a larger step")
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
            remedy = 'write { estimate = ["BONE OF THE ORIGIN", "BONE OF THE INSERTION"] }'
            raise InputError("", f"must name two bones, not {quoted(value)}", remedy)
        return Estimate(*bones)
    if not isinstance(value, list):
        remedy = f'write [{{ role = "origin", bone = "NAME", landmarks = "FILE.vtp" }}], or "{ESTIMATE}"'
        raise InputError("", f"must be a list, not {quoted(value)}", remedy)
    return handler(value)


_Steps = Annotated[Triple, AfterValidator(_steps)]
_Confidence = Annotated[float, Field(ge=0.0, le=1.0)]
_Texts = Annotated[list[Text], BeforeValidator(lambda value: [value] if isinstance(value, str) else value)]


class BoneTable(SchemaTable):
    """A bone."""

    surface: Text


class ColumnTable(SchemaTable):
    """A column of a table of transforms that is a joint coordinate."""

    unit: Annotated[str, OneOf((*ANGLES, *TRANSLATIONS))] = "deg"
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

    role: Annotated[str, OneOf((*ROLES, VIA))]
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
    units: Annotated[str, OneOf(MILLIMETRES)] = "mm"
    deformer: Annotated[str, OneOf(DEFORMERS)] = "paths"
    quality: Annotated[str, OneOf(QUALITIES)] | None = None
    muscle_contact: Annotated[str, OneOf(("off", "on", "measure"))] = "off"
    bones: dict[Name, BoneTable]
    motion: Motion
    joints: dict[str, JointTable] = Field(default_factory=dict)
    opensim: OpenSimTable | None = None
    frame: Annotated[str, OneOf(FRAMES)] = "LPS"
    guessed: dict[str, _Confidence] = Field(default_factory=dict)
    mirror: Annotated[str, OneOf("xyz")] | None = None
    muscles: dict[Name, MuscleTable]
    paths: Paths | None = None
    solver: Solver = Field(default_factory=Solver)
    fixing: Fixing = Field(default_factory=Fixing)


#: The tables with examples; of two fields of a name the last counts.
TABLES: tuple[type[SchemaTable], ...] = (JointTable, Motion, Hinge, BoneTable, Area, MuscleTable, SceneTable)
