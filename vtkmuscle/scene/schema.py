"""The tables of a scene file, as pydantic models: what each key is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    WrapValidator,
)

from vtkmuscle.core.motion.coordinates import ANGLES, TRANSLATIONS
from vtkmuscle.core.words import quoted
from vtkmuscle.data.attachments import ROLES, VIA
from vtkmuscle.filters.deformer.settings import PRESETS
from vtkmuscle.io.slicer import FRAMES
from vtkmuscle.scene.data import MILLIMETRES
from vtkmuscle.scene.joint_schema import Hill, JointTable, OpenSimTable
from vtkmuscle.scene.schema_types import (
    Fibres,
    FiniteNumbers,
    Fixing,
    Name,
    OneOf,
    Solver,
    Table,
    Text,
    Triple,
    direction,
    fault,
)

#: What a scene file has in place of a muscle's attachments, to have them estimated.
ESTIMATE = "estimate"
#: The bone of a motion's only table of transforms; the key ``bone`` names it.
ALONE = ""
#: More frames than this are a slip of the pen in a hinge's step.
MOST_FRAMES = 10_000

_PLACE = FiniteNumbers(3, "3 finite numbers")
_AREA = '{ role = "origin", bone = "NAME", landmarks = "FILE.vtp" }'


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
        raise fault(f"must be a list of columns, not {quoted(value)}", remedy)
    return value


def _file_or_files(value: Any, handler: Callable[[Any], Any]) -> Any:
    if isinstance(value, dict):
        return handler(value)
    if not isinstance(value, str) or not value:
        raise fault(f"must be a text, not {quoted(value)}", "")
    return {ALONE: value}


def _list_or_estimate(value: Any, handler: Callable[[Any], Any]) -> Any:
    if value == ESTIMATE:
        return Estimate()
    if isinstance(value, dict):
        named = value.get(ESTIMATE)
        bones = [one for one in named if isinstance(one, str)] if isinstance(named, list) else []
        if len(bones) != 2 or named != bones or len(value) > 1:
            remedy = '{ estimate = ["BONE OF THE ORIGIN", "BONE OF THE INSERTION"] }'
            raise fault(f"must name two bones, not {quoted(value)}", f"write {remedy}")
        return Estimate(*bones)
    if not isinstance(value, list):
        raise fault(f"must be a list, not {quoted(value)}", f'write [{_AREA}], or "{ESTIMATE}"')
    return handler(value)


class Bone(Table):
    """A bone."""

    surface: Text = Field(
        examples=["FILE.vtp"],
        description="A .vtp, .vtk, .stl, .obj or .ply file in the rest pose, best closed: where the "
        "muscle meets it, holes are closed, with a warning.",
    )


class Coordinate(Table):
    """A column of a table of transforms that is a joint coordinate."""

    unit: Annotated[str, OneOf((*ANGLES, *TRANSLATIONS), "unit")] = Field(
        "deg", examples=["deg"], description="Unit of the column."
    )
    positive: Text | None = Field(None, examples=["flexion"], description="The positive direction, in words.")


def _grids(value: Any) -> Any:
    if not isinstance(value, dict) or not value:
        remedy = "write { knee_angle = [0, 90, 5] }"
        raise fault(f"must be a table of coordinates, not {quoted(value)}", remedy)
    return value


def _centre_or_centres(value: Any, handler: Callable[[Any], Any]) -> Any:
    return handler(value) if isinstance(value, dict) else {ALONE: _PLACE.check(value)}


class Hinge(Table):
    """A bone that turns about an axis."""

    bone: Text = Field(examples=["NAME"], description="The bone that moves.")
    centre: Triple = Field(examples=[[0.0, 0.0, 0.0]], description="A point on the axis, in the rest pose.")
    axis: Annotated[Triple, AfterValidator(direction)] = Field(
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
    """How the bones move: coordinates of joints, a table of transforms, or a hinge."""

    file: Text | None = Field(
        None,
        examples=["walk.mot"],
        description="With [joints.NAME] or [opensim]: a .mot or .sto file of OpenSim with the coordinates of "
        "the joints. Its time is the pipeline's.",
    )
    every: Annotated[int, Field(ge=1)] = Field(
        1, examples=[2], description="Take every so manieth row of the file only."
    )
    grid: (
        Annotated[
            dict[str, Annotated[Triple, AfterValidator(_ascending)]],
            BeforeValidator(_grids),
        ]
        | None
    ) = Field(
        None,
        description="Or coordinates on a grid, { knee_angle = [0, 120, 5], hip_flexion = [0, 90, 10] }: "
        "start, stop (included) and step, in degrees, or the scene's unit for a translation. All values of "
        "the last one are gone through for each value of the one before it, there and back in turn.",
    )

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
    )
    time: Text | None = Field(
        None,
        examples=["COLUMN"],
        description="The column that is the pipeline's time; it must ascend (degrees, seconds, per cent "
        "of a gait cycle). Without it rows are numbered from 0.",
    )
    centre: Annotated[dict[str, Triple], WrapValidator(_centre_or_centres)] | None = Field(
        None,
        examples=[[0.0, 0.0, 0.0]],
        description="The joint's centre in the rest pose, for poses between two rows; or a table of them by "
        "bone.",
    )
    coordinates: Annotated[dict[str, Coordinate], BeforeValidator(_columns)] | None = Field(
        None,
        description="The columns that are joint coordinates, by which moment arms are taken: "
        "['hip_flexion_r'], in degrees, or { hip_flexion_r = { unit = 'deg', positive = "
        "'flexion' } }, with a unit (deg, rad, mm, cm or m) and the positive direction in "
        "words. Columns that do not change are left out. Without this key the column of the "
        "time is one, unless it is called time, frame or the like, or counts the rows. With a file or a "
        "grid: which coordinates of the joints count; without it all that move a bone of the scene.",
    )
    hinge: Hinge | None = Field(None, description="A hinge, instead of all other keys.")


class Area(Table):
    """Where a muscle is attached, or a ring that it passes through."""

    role: Annotated[str, OneOf((*ROLES, VIA), "role")] = Field(
        examples=["origin"],
        description="Origin or insertion; or via, a ring that the muscle passes through. Several areas "
        "may share a role.",
    )
    bone: Text = Field(
        examples=["NAME"], description="The bone that the area is on, or that takes the ring along."
    )
    landmarks: Text = Field(
        examples=["FILE.vtp"],
        description="A .vtp or .vtk file with one polyline, or with points; a .csv of x, y, z, or of name, "
        "x, y, z; a .json list of [x, y, z]; a .mrk.json or .fcsv file of 3D Slicer; or a .nrrd array of "
        "3 x n. Landmarks stand in the order of the boundary.",
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


class Estimate(list[Area]):
    """Attachments that are to be estimated: no areas yet, but both bones, origin first, where named."""

    def __init__(self, *bones: str) -> None:
        super().__init__()
        self.bones = bones


_Texts = Annotated[list[Text], BeforeValidator(lambda one: [one] if isinstance(one, str) else one)]


class Aponeuroses(Table):
    """What a muscle's fibres end on, on its surface or within it, in place of the attachment areas."""

    proximal: _Texts = Field(
        min_length=1,
        examples=["FILE.vtp"],
        description="Where fibres begin: a file or several, with landmarks of a ring on the muscle, in "
        "order; or with a surface of triangles within it (.vtp, .vtk, .stl, .obj, .ply).",
    )
    distal: _Texts = Field(min_length=1, examples=["FILE.vtp"], description="Where they end.")


class MuscleTable(Table):
    """A muscle."""

    surface: Text = Field(
        examples=["FILE.vtp"], description="A closed surface of triangles in one piece, in the rest pose."
    )
    attachments: Annotated[list[Area], WrapValidator(_list_or_estimate)] = Field(
        default_factory=list,
        description="A list of areas; an origin and an insertion are needed for fibres. Or 'estimate', "
        "where there are no landmarks: areas where the muscle touches the bones; or { estimate = "
        "['hip_bone', 'shank'] }, likewise, with the bones of the origin and of the insertion.",
    )
    aponeuroses: Aponeuroses | None = Field(
        None,
        description="What fibres end on instead of areas: { proximal = 'FILE', distal = 'FILE' }.",
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
    crosses: list[Text] | None = Field(
        None,
        examples=[["hip_flexion", "knee_angle"]],
        description="Coordinates of the motion that its lengths depend on; it has moment arms by no others. "
        "With joints, those between its bones; else all.",
    )
    hill: Hill | None = Field(None, description="Hill's parameters, for exports: see `Hill's parameters`_.")


class SceneTable(Table):
    """A scene for vtkmuscle: bones, muscles and a motion."""

    name: Name | None = Field(
        None, examples=["hip"], description="Name of the scene, for titles. Without it the name of the file."
    )
    units: Annotated[str, OneOf(MILLIMETRES, "unit")] = Field(
        "mm",
        examples=["mm"],
        description="Unit of all coordinates, translations and lengths in the scene. What a run reports "
        "is in millimetres where its name says so.",
    )
    quality: Annotated[str, OneOf(PRESETS, "preset")] | None = Field(
        None,
        examples=["balanced"],
        description="A preset of the solver; what [solver] and the muscles set counts more. On the "
        "command line --quality takes its place.",
    )
    model: Annotated[str, OneOf(("volume", "paths"))] = Field(
        "volume",
        examples=["volume"],
        description="volume deforms each muscle. paths pulls its fibres taut round the bones and deforms "
        "nothing: lengths, moment arms and pictures of the fibres; every muscle needs fibres "
        "then, and muscle_contact must be off.",
    )
    muscle_contact: Annotated[str, OneOf(("off", "on", "measure"))] = Field(
        "off",
        examples=["on"],
        description="on keeps each muscle out of those that stand before it in the file, measure reports "
        "how deep it is in them.",
    )
    bones: dict[Name, Bone] = Field(description="The bones, by name; at least one.")
    motion: Motion = Field(description="How the bones move.")
    joints: dict[str, JointTable] = Field(
        default_factory=dict, description="Joints between the bones, by name, which [motion] moves."
    )
    opensim: OpenSimTable | None = Field(
        None, description="A model of OpenSim that has the joints, in place of [joints.NAME]."
    )
    frame: Annotated[str, OneOf(FRAMES, "frame")] = Field(
        "LPS",
        examples=["LPS"],
        description="The frame of the surfaces: LPS (x to the left, y to the back), as 3D Slicer saves them, "
        "or RAS. Landmarks whose file says its frame, as those of 3D Slicer, are turned to it; others "
        "stay.",
    )
    mirror: Annotated[str, OneOf("xyz")] | None = Field(
        None,
        examples=["x"],
        description="x, y or z: all that was read, motion included, is mirrored along this axis, to make the "
        "other side of the body. Names and coordinates stay.",
    )
    muscles: dict[Name, MuscleTable] = Field(description="The muscles, by name; at least one.")
    solver: Solver = Field(default_factory=Solver, description="Parameters of PBDDeformer for all muscles.")
    fixing: Fixing = Field(
        default_factory=Fixing, description="Parameters of FixedPointDetector for all muscles."
    )
