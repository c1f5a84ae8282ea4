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
    key,
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

    surface: Text = key("FILE.vtp", ...)
    """A .vtp, .vtk, .vtu, .stl, .obj, .ply, .off or .glb file in the rest pose, preferably closed: where the
    muscle meets the bone, holes are closed, with a warning."""


class ColumnTable(SchemaTable):
    """A column of a table of transforms that is a joint coordinate."""

    unit: Annotated[str, OneOf((*ANGLES, *TRANSLATIONS))] = key("deg", "deg")
    """Unit of the column."""
    positive: Text | None = key("flexion")
    """The positive direction, in words."""


class Hinge(SchemaTable):
    """A bone that turns about an axis."""

    bone: Text = key("NAME", ...)
    """The moving bone."""
    centre: Triple = key([0.0, 0.0, 0.0], ...)
    """A point on the axis, in the rest pose."""
    axis: Direction = key([1.0, 0.0, 0.0], ...)
    """Direction of the axis, of any length; positive angles are right-handed."""
    angles: _Steps = key([0, 90, 2], ...)
    """Start, stop (included) and step, in degrees from rest. The angle is the pipeline's time. To turn
    backwards, negate the axis."""
    coordinate: Text | None = key("knee_flexion")
    """Name of the angle, for moment arms. Default: BONE_angle."""


class Motion(SchemaTable):
    """How the bones move: coordinates of joints, a table of transforms, or a hinge."""

    file: Text | None = key("walk.mot")
    """With [joints.NAME] or [opensim]: a .mot or .sto file of OpenSim with the coordinates of the joints. The
    file's time is the pipeline's."""
    every: Annotated[int, Field(ge=1)] = key(2, 1)
    """Take only every n-th row of the file."""
    grid: Annotated[dict[str, _Steps], Field(min_length=1)] | None = key({"knee_angle": [0, 90, 5]})
    """Or coordinates on a grid, { knee_angle = [0, 120, 5], hip_flexion = [0, 90, 10] }: start, stop
    (included) and step, in degrees, or the scene's unit for a translation. The last coordinate changes
    fastest, up and down in turn."""
    bone: Text | None = key("NAME")
    """The moving bone; all further bones are fixed."""
    transforms: Annotated[dict[str, Text], BeforeValidator(_by_bone), Field(min_length=1)] | None = key(
        "FILE.csv"
    )
    """A CSV file with the columns T00 to T33: the bone's 4 x 4 transform from rest to the pose, row major,
    translations in the scene's unit. The last row (T30 to T33) may be omitted. Further columns, empty lines
    and comments (#) are ignored. For several moving bones: a table of files, { femur = 'femur.csv', tibia =
    'tibia.csv' }, with equal times, and without the key bone."""
    time: Text | None = key("COLUMN")
    """The column of the pipeline's time, ascending (degrees, seconds, per cent of a gait cycle). Default:
    rows are numbered from 0."""
    centre: Annotated[dict[str, Triple], BeforeValidator(_by_bone)] | None = key([0.0, 0.0, 0.0])
    """The joint's centre in the rest pose, for poses between two rows; or a table of centres by bone."""
    coordinates: Annotated[dict[str, ColumnTable], BeforeValidator(names_or_tables)] | None = None
    """The columns of joint coordinates, for moment arms: ['hip_flexion_r'], in degrees, or { hip_flexion_r =
    { unit = 'deg', positive = 'flexion' } }, with a unit (deg, rad, mm, cm or m) and the positive direction
    in words. Constant columns are ignored. Default: the column of the time, unless the column is called time
    or frame, or counts the rows. With a file or a grid: the coordinates to use; by default all coordinates
    that move a bone of the scene."""
    hinge: Hinge | None = None
    """A hinge, instead of all other keys."""


class Area(SchemaTable):
    """An attachment area of a muscle, or a via ring."""

    role: Annotated[str, OneOf((*ROLES, VIA))] = key("origin", ...)
    """origin or insertion; or via, a ring round the muscle. Several areas may share a role."""
    bone: Text = key("NAME", ...)
    """The bone of the area or ring."""
    landmarks: Text = key("FILE.vtp", ...)
    """A .vtp or .vtk file with a polyline, or with points; a .csv of x, y, z, or of name, x, y, z; a .json
    list of [x, y, z]; a .mrk.json or .fcsv file of 3D Slicer; or a .nrrd file of 3 x n numbers. Landmarks
    are in the order of the boundary."""
    closed: bool | None = key(True)
    """Write true for a ring around an area, false for an open curve or loose points. Default: as in the file;
    a ring repeats the first landmark at the end. Points near an open curve are attached. A via ring is always
    closed."""
    estimated: bool = key(True, False)
    """True for estimated landmarks, as written by Scene.save."""
    confidence: _Confidence | None = key(0.4)
    """Confidence of a guessed area or bone, 0 to 1. Remove the key after a check of the area."""


class Estimate(list[Area]):
    """Attachments to be estimated, with both bones named, origin first, or none."""

    def __init__(self, *bones: str) -> None:
        super().__init__()
        self.bones = bones


class Aponeuroses(SchemaTable):
    """End surfaces of a muscle's fibres, in place of the attachment areas."""

    proximal: Annotated[_Texts, Field(min_length=1)] = key("FILE.vtp", ...)
    """Start of the fibres: a file or several, with landmarks of a ring on the muscle, in order; or with a
    surface of triangles within the ring (.vtp, .vtk, .stl, .obj, .ply)."""
    distal: Annotated[_Texts, Field(min_length=1)] = key("FILE.vtp", ...)
    """End of the fibres, as proximal."""


class MuscleTable(SchemaTable):
    """A muscle."""

    surface: Text = key("FILE.vtp", ...)
    """A closed surface of triangles, in a single piece, in the rest pose."""
    attachments: Annotated[list[Area], WrapValidator(_list_or_estimate)] = Field(default_factory=list)
    """A list of areas; fibres need an origin and an insertion. Or 'estimate', without landmarks: areas in
    contact with the bones; or { estimate = ['hip_bone', 'shank'] }, with the bones of the origin and of the
    insertion."""
    aponeuroses: Aponeuroses | None = None
    """End surfaces of the fibres, instead of areas: { proximal = 'FILE', distal = 'FILE' }."""
    fibres: Fibres | None = None
    """Settings of the fibres, e.g. { template = 'parallel', n_fibres = 100, resolution = 15 }: the kind of
    template, the number of fibres and of segments of each; or template_file = 'FILE.toml', a template of your
    own. Without the table the muscle has no fibres."""
    superficial_fibres: Text | None = key("FILE.vtp")
    """A .vtp, .vtk, .obj or .ply file of polylines: fibres observed on the surface."""
    solver: Solver = Field(default_factory=Solver)
    """Parameters in place of [solver]."""
    fixing: Fixing = Field(default_factory=Fixing)
    """Parameters in place of [fixing]."""
    literature: Text | None = key("FILE.csv")
    """A .csv file of published moment arms, drawn with the moment arms of the run."""
    crosses: list[Text] | None = key(["hip_flexion", "knee_angle"])
    """Coordinates with an effect on the muscle's length, for moment arms. Default: the coordinates of the
    joints between the muscle's bones; without joints, all."""
    hill: Hill | None = None
    """Hill's parameters, for exports: see `Hill's parameters`_."""
    muscle: Text | None = key("semimembranosus")
    """Anatomical name, for published numbers. Default: the muscle's name in the scene."""


class SceneTable(SchemaTable):
    """A scene for vtkmuscle: bones, muscles and a motion."""

    name: Name | None = key("hip")
    """Name of the scene, for titles. Default: the name of the file."""
    units: Annotated[str, OneOf(MILLIMETRES)] = key("mm", "mm")
    """Unit of all coordinates, translations and lengths in the scene. Results with _mm in the name are in
    millimetres."""
    deformer: Annotated[str, OneOf(DEFORMERS)] = key("paths", "paths")
    """paths: taut paths carry each muscle. pbd: position based dynamics, with paths only for a table [paths].
    none: paths alone, for lengths, moment arms and pictures of the fibres; all muscles need fibres, and
    muscle_contact must be off. --deformer of the command line has priority."""
    quality: Annotated[str, OneOf(QUALITIES)] | None = key("balanced")
    """A preset for [paths] and [solver]; settings in the tables have priority. published needs the deformer
    pbd. --quality of the command line has priority."""
    muscle_contact: Annotated[str, OneOf(("off", "on", "measure"))] = key("on", "off")
    """on: muscles stay outside of earlier muscles of the file. measure: reports the depth in earlier
    muscles."""
    bones: dict[Name, BoneTable] = key({"NAME": {"surface": "FILE.vtp"}}, ...)
    """The bones, by name; at least one."""
    motion: Motion = key({"bone": "NAME", "transforms": "FILE.csv"}, ...)
    """How the bones move."""
    joints: dict[str, JointTable] = Field(default_factory=dict)
    """Joints between the bones, by name, moved by [motion]."""
    opensim: OpenSimTable | None = None
    """An OpenSim model with the joints, in place of [joints.NAME]."""
    frame: Annotated[str, OneOf(FRAMES)] = key("LPS", "LPS")
    """The frame of the surfaces: LPS (x to the left, y to the back), as in 3D Slicer, or RAS. Landmarks are
    converted if the file states the frame, as files of 3D Slicer do."""
    guessed: dict[str, _Confidence] = key({"joints.knee_right.centre": 0.8}, {})
    """Confidence of guesses by their keys, 0 to 1, in a drafted scene. Remove a key after a check of the
    guess."""
    mirror: Annotated[str, OneOf("xyz")] | None = key("x")
    """x, y or z: mirrors the whole scene, with the motion, along this axis, to make the other side of the
    body. Names and coordinates stay."""
    muscles: dict[Name, MuscleTable] = key({"NAME": {"surface": "FILE.vtp"}}, ...)
    """The muscles, by name; at least one."""
    paths: Paths | None = None
    """Parameters of TautPaths for all muscles."""
    solver: Solver = Field(default_factory=Solver)
    """Parameters of the deformer, PathDeformer or PBDDeformer, for all muscles."""
    fixing: Fixing = Field(default_factory=Fixing)
    """Parameters of FixedPointDetector for all muscles."""


#: The tables with examples; of two fields of a name the last counts.
TABLES: tuple[type[SchemaTable], ...] = (JointTable, Motion, Hinge, BoneTable, Area, MuscleTable, SceneTable)
