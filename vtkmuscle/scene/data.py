"""Content of a scene: bones, muscles, attachments, motion, settings; errors of scenes and of their files."""

import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.bones.bone import Bone, bone_of
from vtkmuscle.core.errors import MOST_TEXT, InputError, check_is_file, fault_of, in_words
from vtkmuscle.core.motion.coordinates import MILLIMETRES
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.core.words import quoted
from vtkmuscle.data import attachments as attached
from vtkmuscle.data import toml_table
from vtkmuscle.data.arrays import checked_surface, multiblock_from
from vtkmuscle.io.literature import LiteratureCurve


@dataclass(frozen=True, eq=False, repr=False)
class Muscle:
    """A muscle of a scene.

    Attributes
    ----------
    surface : vtkPolyData
        Closed surface of triangles that face outward, in the rest pose.
    attachments : sequence of AttachmentArea, or vtkMultiBlockDataSet
        Attachment areas and via rings; ``(role, bone, landmarks, closed)`` is also an area.
    fibres : mapping, optional
        Keyword arguments of :func:`vtkmuscle.pipelines.decompose`, and ``weight_tolerance`` of
        FibreTransport, by default 0.3, 0 for exact transport; None for a muscle without fibres.
    solver, fixing : mapping
        Parameters of the deformer and of FixedPointDetector that differ from the scene's.
    superficial_fibres : vtkPolyData, optional
        Polylines: fibres observed on the surface, in the rest pose. They orient the template.
    literature : sequence of LiteratureCurve
        Published moment arms of the muscle, for the figures of a run.
    crosses : tuple of str, optional
        Coordinates of the motion that affect the muscle's lengths; None if unknown, for all.
    aponeuroses : sequence of Aponeurosis, or vtkMultiBlockDataSet
        End surfaces of fibres, on or within the muscle, at rest; without any, the attachment areas.
    hill : mapping of str to float
        Hill's parameters, by the names of :class:`~vtkmuscle.scene.schema.Hill`; exports write them.
    muscle : str
        Name of the muscle in anatomy, for published numbers; by default the name in the scene.
    """

    surface: vtkPolyData
    attachments: tuple[attached.AttachmentArea, ...] = ()
    fibres: Mapping[str, Any] | None = None
    solver: Mapping[str, Any] = field(default_factory=dict)
    fixing: Mapping[str, Any] = field(default_factory=dict)
    superficial_fibres: vtkPolyData | None = None
    literature: tuple[LiteratureCurve, ...] = ()
    crosses: tuple[str, ...] | None = None
    hill: Mapping[str, float] = field(default_factory=dict)
    aponeuroses: tuple[attached.Aponeurosis, ...] = ()
    muscle: str = ""

    def __post_init__(self) -> None:
        surface: Any = self.surface
        if not isinstance(surface, vtkPolyData):
            hint = "pyvista.read(path) reads one from a file"
            raise TypeError(f"Muscle takes a surface, but got {quoted(surface)}; {hint}")
        areas: Any = self.attachments
        if isinstance(areas, vtkMultiBlockDataSet):
            areas = attached.attachments_of(areas, "attachments")
        areas = [attached.AttachmentArea(*area) if isinstance(area, tuple) else area for area in areas]
        if not all(isinstance(area, attached.AttachmentArea) for area in areas):
            hint = "AttachmentEstimator(muscle=surface, bones=bones).apply() estimates them"
            raise TypeError(f"Muscle takes attachment areas, but got {quoted(self.attachments)}; {hint}")
        object.__setattr__(self, "attachments", tuple(areas))
        sheets: Any = self.aponeuroses
        if isinstance(sheets, vtkMultiBlockDataSet):
            sheets = attached.aponeuroses_of(sheets, "aponeuroses")
        object.__setattr__(self, "aponeuroses", tuple(sheets))

    def __repr__(self) -> str:
        areas = ", ".join(f"{area.role} on {area.bone}" for area in self.attachments) or "no attachments"
        fibres = "no fibres" if self.fibres is None else f"fibres {dict(self.fibres)}"
        return f"Muscle({self.surface.GetNumberOfCells()} triangles; {areas}; {fibres})"


@dataclass(frozen=True, eq=False)
class SceneData:
    """Fields of a :class:`vtkmuscle.Scene`, documented and checked there."""

    name: str
    bones: Mapping[str, vtkPolyData]
    muscles: Mapping[str, Muscle]
    motion: RigidMotion
    units: str = "mm"
    solver: Mapping[str, Any] = field(default_factory=dict)
    fixing: Mapping[str, Any] = field(default_factory=dict)
    muscle_contact: str = "off"
    deformer: str = "paths"
    paths: Mapping[str, Any] | None = None
    quality: str | None = None
    frame: str = "LPS"
    guessed: Mapping[str, float] = field(default_factory=dict)
    joints: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    files: Mapping[str, Path] = field(default_factory=dict)

    @property
    def millimetres(self) -> float:
        """Millimetres per unit of length."""
        return MILLIMETRES[self.units]

    def solver_of(self, muscle: str) -> dict[str, Any]:
        """Return a muscle's deformer parameters; its own override the scene's."""
        return {**self.solver, **self.muscles[muscle].solver}

    def fixing_of(self, muscle: str) -> dict[str, Any]:
        """Return a muscle's FixedPointDetector parameters, own before scene's."""
        return {**self.fixing, **self.muscles[muscle].fixing}

    def bones_data(self) -> vtkMultiBlockDataSet:
        """Return the bones at rest as a data set for filters."""
        return multiblock_from(dict(self.bones))

    def attachments_data(self, muscle: str) -> vtkMultiBlockDataSet | None:
        """Return a muscle's attachments as a data set, None without any."""
        areas = self.muscles[muscle].attachments
        return attached.attachments_from(areas) if areas else None

    def aponeuroses_data(self, muscle: str) -> vtkMultiBlockDataSet | None:
        """Return a muscle's aponeuroses as a data set, None without any."""
        sheets = self.muscles[muscle].aponeuroses
        return attached.aponeuroses_data(sheets) if sheets else None


class RestSurface(NamedTuple):
    """A surface: points (n, 3), and triangles (m, 3) of point ids."""

    points: Floats
    triangles: Ints


@dataclass(frozen=True, eq=False)
class Anatomy:
    """Bones and muscles of a scene at rest, by name."""

    bones: Mapping[str, Bone]
    muscles: Mapping[str, RestSurface]

    @classmethod
    def of(cls, scene: SceneData) -> Self:
        """Return a scene's surfaces; ValueError without triangles, or not finite."""
        bones = {name: bone_of(*checked_surface(bone, name)) for name, bone in scene.bones.items()}
        surfaces = {name: checked_surface(muscle.surface, name) for name, muscle in scene.muscles.items()}
        return cls(bones, {name: RestSurface(*surface) for name, surface in surfaces.items()})

    @property
    def solid_bones(self) -> dict[str, Bone]:
        """Bones with an inside, holes closed."""
        return {name: bone for name, bone in self.bones.items() if bone.solids.trees}


_WORDS = toml_table("vtkmuscle.scene", "faults.toml")


def words_of(fault: str, **values: object) -> tuple[str, str]:
    """Return the problem and the remedy of a fault in words."""
    problem, remedy = (words.format(**values) for words in _WORDS[fault])
    return problem, remedy


class SceneError(InputError):
    """A scene that cannot be run, with location, problem and remedy of each fault.

    Attributes
    ----------
    problem, remedy, where : str
        Fault, correction, and file and key, of the first fault.
    key, file : str, Path or None
        The dotted key, e.g. ``muscles.iliacus.attachments[1].bone``, and the file at fault.
    faults : tuple of SceneError
        All faults, starting with the error itself. The message has a line for each.

    Examples
    --------
    >>> from vtkmuscle import SceneError
    >>> print(SceneError("there is no unit 'inch'", "units", "allowed: mm, cm, m"))
    scene: units: there is no unit 'inch'; allowed: mm, cm, m
    """

    def __init__(
        self, problem: str, key: str = "", remedy: str = "", file: Path | None = None,
        more: Iterable["SceneError"] = (),
    ) -> None:  # fmt: skip
        where = ": ".join(part for part in (str(file) if file else "scene", key) if part)
        super().__init__(where, problem, remedy)
        self.key, self.file, self.faults = key, file, (self, *more)
        self.args = (problem, key, remedy, file, self.faults[1:])

    def __str__(self) -> str:
        return "\n".join(in_words(fault.where, fault.problem, fault.remedy) for fault in self.faults)


class Finding(NamedTuple):
    """An implausible part of a scene; ``certain`` stops runs."""

    key: str
    problem: str
    remedy: str
    certain: bool = False


@contextmanager
def scene_errors_at(key: str, file: Path | None, remedy: str = "") -> Iterator[None]:
    """Raise a ValueError or OSError as a SceneError with key and file."""
    try:
        yield
    except (ValueError, OSError) as error:
        problem, own = fault_of(error)
        raise SceneError(problem, key, own or remedy, file) from error


class Faults:
    """Collector of faults from several checks, for a common report."""

    def __init__(self, errors: Iterable[SceneError] = ()) -> None:
        self.errors = list(errors)

    @contextmanager
    def gathered(self) -> Iterator[None]:
        """Collect the faults of a SceneError raised within, and continue."""
        try:
            yield
        except SceneError as error:
            self.errors += error.faults

    def raise_any(self) -> None:
        """Raise one SceneError for all faults, if any."""
        if self.errors:
            first, *more = self.errors
            raise SceneError(first.problem, first.key, first.remedy, first.file, more)


T = TypeVar("T")


def parsed(path: Path) -> dict[str, Any]:
    """Return the content of a scene.toml; SceneError if unreadable."""
    if path.is_dir():
        inside = [path / "scene.toml", *sorted(path.glob("*.toml")), path.absolute().parent / "scene.toml"]
        remedy = f"give a scene file, e.g. {next(filter(Path.is_file, inside), 'scene.toml')}"
        raise SceneError("this is a folder, not a scene file", "", remedy, path)
    try:
        check_is_file(path, most=MOST_TEXT)
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError as error:
        raise SceneError("is not text in UTF-8", "", "save it as UTF-8", path) from error
    except tomllib.TOMLDecodeError as error:
        remedy = "correct that line; put texts in double quotes, and write / for \\ in paths"
        raise SceneError(f"is not valid TOML: {error}", "", remedy, path) from error
    except (OSError, ValueError, RecursionError) as error:  # also an endless number, or too many brackets
        raise SceneError(fault_of(error)[0], "", "check the path and the content", path) from error


class SceneFiles:
    """Paths of a scene's files by dotted key, relative to the scene file, and faults of the files."""

    def __init__(self, path: Path) -> None:
        self.paths, self.faults = {"": path}, Faults()

    def read(self, key: str, text: str, reader: Callable[[Path], T]) -> T:
        """Read the file of a key by a reader; SceneError if unreadable."""
        path = self.paths[""].parent / text
        self.paths[key] = path
        with scene_errors_at(key, path, f"check {key.rpartition('.')[2]} = {text!r} and the file it names"):
            return reader(path)

    def tried(self, key: str, text: str | None, reader: Callable[[Path], T]) -> T | None:
        """Read as :meth:`read`, if there is a text. Gather the fault of an unreadable file."""
        if text is not None:
            with self.faults.gathered():
                return self.read(key, text, reader)
        return None
