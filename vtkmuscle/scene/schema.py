"""The tables of a scene file, as pydantic models: what each key is, and the JSON schema for editors.

``python -m vtkmuscle.scene.schema`` prints the JSON schema, which is ``docs/_static/scene.schema.json``.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable
from math import isfinite
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainValidator,
    StringConstraints,
    WithJsonSchema,
    WrapValidator,
)
from pydantic_core import CoreSchema
from pydantic_core.core_schema import no_info_plain_validator_function

from vtkmuscle.core.motion.coordinates import ANGLES, TRANSLATIONS
from vtkmuscle.core.words import shown, suggestion
from vtkmuscle.data.attachments import ROLES, VIA
from vtkmuscle.filters.deformer.quality import PRESETS
from vtkmuscle.scene.data import MILLIMETRES
from vtkmuscle.scene.names import checked_name
from vtkmuscle.scene.settings import Fibres, Fixing, Solver, fault

#: What a scene file has in place of a muscle's attachments, to have them estimated.
ESTIMATE = "estimate"
#: The bone of a motion's only table of transforms; the key ``bone`` names it.
ALONE = ""
#: More frames than this are a slip of the pen in a hinge's step.
MOST_FRAMES = 10_000

_AREA = '{ role = "origin", bone = "NAME", landmarks = "FILE.vtp" }'


def _three(value: Any) -> list[float]:
    good = isinstance(value, list | tuple) and len(value) == 3
    if not good or not all(
        isinstance(v, int | float) and not isinstance(v, bool) and _finite(v) for v in value
    ):
        raise fault(f"must be 3 finite numbers, not {shown(value)}", "")
    return [float(v) for v in value]


def _finite(value: float) -> bool:
    try:
        return isfinite(value)
    except OverflowError:  # an integer that no float is as large as
        return False


def _direction(axis: list[float]) -> list[float]:
    if not any(axis):
        raise fault("has no length", "write axis = [1.0, 0.0, 0.0], or another direction")
    return axis


def _ascending(angles: list[float]) -> list[float]:
    start, stop, step = angles
    if not (step > 0 and stop >= start):
        remedy = (
            "write [start, stop, step] with step > 0 and stop >= start; to turn the other way, negate axis"
        )
        raise fault(f"[{start:g}, {stop:g}, {step:g}] does not ascend", remedy)
    if (stop - start) / step > MOST_FRAMES:
        raise fault(f"are {(stop - start) / step:.3g} frames", "choose a larger step")
    return angles


def _columns(value: Any) -> Any:
    if isinstance(value, list) and all(isinstance(name, str) for name in value):
        return {name: {} for name in value}
    if not isinstance(value, dict):
        remedy = 'write ["COLUMN"], or { COLUMN = { unit = "deg", positive = "flexion" } }'
        raise fault(f"must be a list of columns, not {shown(value)}", remedy)
    return value


def _file_or_files(value: Any, handler: Callable[[Any], Any]) -> Any:
    if isinstance(value, dict):
        return handler(value)
    if not isinstance(value, str) or not value:
        raise fault(f"must be a text, not {shown(value)}", "")
    return {ALONE: value}


def _list_or_estimate(value: Any, handler: Callable[[Any], Any]) -> Any:
    if value == ESTIMATE:
        return None
    if not isinstance(value, list):
        raise fault(f"must be a list, not {shown(value)}", f'write [{_AREA}], or "{ESTIMATE}"')
    return handler(value)


def _or(**other: Any) -> Callable[[Any], None]:
    """Return what adds a choice to the JSON schema of a key."""
    return lambda schema: schema["anyOf"].insert(0, other)


class _OneOf:
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
    PlainValidator(_three),
    WithJsonSchema({"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}),
]


class Table(BaseModel):
    """A table of a scene file: strict in its types, and without unknown keys."""

    model_config = ConfigDict(extra="forbid", strict=True)


class Bone(Table):
    """A bone."""

    surface: Text = Field(
        examples=["FILE.vtp"],
        description="A .vtp, .vtk, .stl, .obj or .ply file in the rest pose, best closed: where the "
        "muscle meets it, holes are closed, with a warning.",
    )


class Coordinate(Table):
    """A column of a table of transforms that is a joint coordinate."""

    unit: Annotated[str, _OneOf((*ANGLES, *TRANSLATIONS), "unit")] = Field(
        "deg", examples=["deg"], description="Unit of the column."
    )
    positive: Text | None = Field(None, examples=["flexion"], description="The positive direction, in words.")


class Hinge(Table):
    """A bone that turns about an axis."""

    bone: Text = Field(examples=["NAME"], description="The bone that moves.")
    centre: Triple = Field(examples=[[0.0, 0.0, 0.0]], description="A point on the axis, in the rest pose.")
    axis: Annotated[Triple, AfterValidator(_direction)] = Field(
        examples=[[1.0, 0.0, 0.0]],
        description="Direction of the axis, of any length; positive angles turn right-handed about it.",
    )
    angles: Annotated[Triple, AfterValidator(_ascending)] = Field(
        examples=[[0, 90, 2]],
        description="Start, stop (included) and step, in degrees from rest. The angle is the pipeline's "
        "time. To turn the other way, negate the axis.",
    )
    coordinate: Text | None = Field(
        None,
        examples=["knee_flexion"],
        description="Name of the angle: moment arms are taken by it. Without it, BONE_angle.",
    )


class Motion(Table):
    """How the bones move: a table of transforms, or a hinge."""

    bone: Text | None = Field(
        None, examples=["NAME"], description="The bone that moves; every other bone stays where it is."
    )
    transforms: Annotated[dict[str, Text], WrapValidator(_file_or_files)] | None = Field(
        None,
        examples=["FILE.csv"],
        description="A CSV file with the columns T00 to T33: the bone's 4 x 4 transform from rest to its "
        "pose, row major, translations in the scene's unit. The last row (T30 to T33) may be "
        "left out. Other columns, empty lines and lines that begin with # are passed over. "
        "Where several bones move: a table of such files, { femur = 'femur.csv', tibia = "
        "'tibia.csv' }, with the same times in each, and without the key bone.",
        json_schema_extra=_or(type="string", minLength=1),
    )
    time: Text | None = Field(
        None,
        examples=["COLUMN"],
        description="The column that is the pipeline's time; it must ascend (degrees, seconds, per cent "
        "of a gait cycle). Without it rows are numbered from 0.",
    )
    centre: Triple | None = Field(
        None,
        examples=[[0.0, 0.0, 0.0]],
        description="The joint's centre in the rest pose, for poses between two rows.",
    )
    coordinates: Annotated[dict[str, Coordinate], BeforeValidator(_columns)] | None = Field(
        None,
        description="The columns that are joint coordinates, by which moment arms are taken: "
        "['hip_flexion_r'], in degrees, or { hip_flexion_r = { unit = 'deg', positive = "
        "'flexion' } }, with a unit (deg, rad, mm, cm or m) and the positive direction in "
        "words. Columns that do not change are left out. Without this key the column of the "
        "time is one, unless it is called time, frame or the like, or counts the rows.",
        json_schema_extra=_or(type="array", items={"type": "string"}),
    )
    hinge: Hinge | None = Field(None, description="A hinge, instead of all other keys.")


class Area(Table):
    """Where a muscle is attached, or a ring that it passes through."""

    role: Annotated[str, _OneOf((*ROLES, VIA), "role")] = Field(
        examples=["origin"],
        description="Origin or insertion; or via, a ring that the muscle passes through. Several areas "
        "may share a role.",
    )
    bone: Text = Field(
        examples=["NAME"], description="The bone that the area is on, or that takes the ring along."
    )
    landmarks: Text = Field(
        examples=["FILE.vtp"],
        description="A .vtp or .vtk file with one polyline, or with points; a .csv of x, y, z; or a .json "
        "list of [x, y, z]. Landmarks stand in the order of the boundary.",
    )
    closed: bool | None = Field(
        None,
        examples=[True],
        description="Write true for a ring around an area, false for an open curve or loose points. "
        "Without it as in the file: a ring ends at the landmark that it began with. What lies "
        "near an open curve is attached. A via ring is closed anyway.",
    )
    estimated: bool = Field(
        False,
        examples=[True],
        description="Write true where nobody has seen the landmarks, as Scene.save does.",
    )


class MuscleTable(Table):
    """A muscle."""

    surface: Text = Field(
        examples=["FILE.vtp"], description="A closed surface of triangles in one piece, in the rest pose."
    )
    attachments: Annotated[list[Area] | None, WrapValidator(_list_or_estimate)] = Field(
        default_factory=list,
        description="A list of areas; an origin and an insertion are needed for fibres. Or 'estimate', "
        "where there are no landmarks: areas where the muscle touches the bones.",
        json_schema_extra=_or(const=ESTIMATE),
    )
    fibres: Fibres | None = Field(
        None,
        description="Settings of the fibres, e.g. { template = 'parallel', n_fibres = 100, resolution = "
        "15 }: the kind of template, the number of fibres and that of segments of each; or "
        "template_file = 'FILE.toml', a template of your own. Without this table the muscle "
        "has no fibres.",
    )
    superficial_fibres: Text | None = Field(
        None,
        examples=["FILE.vtp"],
        description="A .vtp, .vtk, .obj or .ply file of polylines: fibres that somebody has seen on the "
        "surface.",
    )
    solver: Solver = Field(default_factory=Solver, description="Parameters that differ from [solver].")
    fixing: Fixing = Field(default_factory=Fixing, description="Parameters that differ from [fixing].")
    literature: Text | None = Field(
        None,
        examples=["FILE.csv"],
        description="A .csv file of published moment arms, drawn beside those of the run.",
    )


class SceneTable(Table):
    """A scene for vtkmuscle: bones, muscles and a motion."""

    name: Name | None = Field(
        None, examples=["hip"], description="Name of the scene, for titles. Without it the name of the file."
    )
    units: Annotated[str, _OneOf(MILLIMETRES, "unit")] = Field(
        "mm",
        examples=["mm"],
        description="Unit of all coordinates, translations and lengths in the scene. What a run reports "
        "is in millimetres where its name says so.",
    )
    quality: Annotated[str, _OneOf(PRESETS, "preset")] | None = Field(
        None,
        examples=["balanced"],
        description="A preset of the solver; what [solver] and the muscles set counts more. On the "
        "command line --quality takes its place.",
    )
    model: Annotated[str, _OneOf(("volume", "paths"))] = Field(
        "volume",
        examples=["volume"],
        description="volume deforms each muscle. paths pulls its fibres taut round the bones and deforms "
        "nothing: lengths, moment arms and pictures of the fibres; every muscle needs fibres "
        "then, and muscle_contact must be off.",
    )
    muscle_contact: Annotated[str, _OneOf(("off", "on", "measure"))] = Field(
        "off",
        examples=["on"],
        description="on keeps each muscle out of those that stand before it in the file, measure reports "
        "how deep it is in them.",
    )
    bones: dict[Name, Bone] = Field(description="The bones, by name; at least one.")
    motion: Motion = Field(description="How the bones move.")
    muscles: dict[Name, MuscleTable] = Field(description="The muscles, by name; at least one.")
    solver: Solver = Field(default_factory=Solver, description="Parameters of PBDDeformer for all muscles.")
    fixing: Fixing = Field(
        default_factory=Fixing, description="Parameters of FixedPointDetector for all muscles."
    )


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of a scene file, for completion and checks in editors."""
    schema = SceneTable.model_json_schema()
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_without_null(schema)}


def _without_null(schema: Any) -> Any:
    """Return a JSON schema without null, which TOML does not know."""
    if isinstance(schema, list):
        return [_without_null(one) for one in schema if one != {"type": "null"}]
    if not isinstance(schema, dict):
        return schema
    plain = {name: _without_null(one) for name, one in schema.items() if (name, one) != ("default", None)}
    if len(plain.get("anyOf", ())) == 1:
        plain |= plain.pop("anyOf")[0]
    return plain


if __name__ == "__main__":
    sys.stdout.write(json.dumps(json_schema(), indent=1, ensure_ascii=False) + "\n")
