"""The content of a scene: bones, muscles with attachments, a motion, settings; its surfaces as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, Self

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.bones.bone import Bone, bone_of
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.core.words import quoted
from vtkmuscle.data.arrays import checked_surface, multiblock_from
from vtkmuscle.data.attachments import (
    Aponeurosis,
    AttachmentArea,
    aponeuroses_data,
    aponeuroses_of,
    attachments_from,
    attachments_of,
)
from vtkmuscle.io.literature import LiteratureCurve

#: Allowed units of length, and how many millimetres they are.
MILLIMETRES = {"mm": 1.0, "cm": 10.0, "m": 1000.0}


@dataclass(frozen=True, eq=False, repr=False)
class Muscle:
    """A muscle of a scene.

    Attributes
    ----------
    surface : vtkPolyData
        Closed surface of triangles that face outward, in the rest pose.
    attachments : sequence of AttachmentArea, or vtkMultiBlockDataSet
        Where it is attached, and the via rings that it passes through; ``(role, bone, landmarks, closed)`` is
        an area, too.
    fibres : mapping, optional
        Keyword arguments of :func:`vtkmuscle.pipelines.decompose`, and ``weight_tolerance`` of
        FibreTransport, 0.3 where it is not given, 0 for exact transport; None for a muscle without fibres.
    solver : mapping
        Parameters of the deformer that differ from the scene's.
    fixing : mapping
        Parameters of FixedPointDetector that differ from the scene's.
    superficial_fibres : vtkPolyData, optional
        Polylines: fibres that somebody has seen on the surface, in the rest pose. They orient the template
        and say which edges are soft where Algorithm 2 is used.
    literature : sequence of LiteratureCurve
        Published moment arms of the muscle, drawn beside those of a run.
    crosses : tuple of str, optional
        Coordinates of the motion that its lengths depend on; None where that is not known, and all may.
    aponeuroses : sequence of Aponeurosis, or vtkMultiBlockDataSet
        What its fibres end on, on its surface or within it, in the rest pose; none: the attachment areas.
    hill : mapping of str to float
        Hill's parameters, by the names of :class:`~vtkmuscle.scene.joint_schema.Hill`; exports write them.
    """

    surface: vtkPolyData
    attachments: tuple[AttachmentArea, ...] = ()
    fibres: Mapping[str, Any] | None = None
    solver: Mapping[str, Any] = field(default_factory=dict)
    fixing: Mapping[str, Any] = field(default_factory=dict)
    superficial_fibres: vtkPolyData | None = None
    literature: tuple[LiteratureCurve, ...] = ()
    crosses: tuple[str, ...] | None = None
    hill: Mapping[str, float] = field(default_factory=dict)
    aponeuroses: tuple[Aponeurosis, ...] = ()

    def __post_init__(self) -> None:
        given: Any = self.surface
        if not isinstance(given, vtkPolyData):
            got = quoted(given)
            raise TypeError(
                f"Muscle takes a surface, but got {got}; pyvista.read(path) reads one from a file"
            )
        given = self.attachments
        areas = attachments_of(given, "attachments") if isinstance(given, vtkMultiBlockDataSet) else given
        areas = [AttachmentArea(*one) if isinstance(one, tuple) else one for one in areas]
        object.__setattr__(self, "attachments", tuple(areas))
        given = self.aponeuroses
        sheets = aponeuroses_of(given, "aponeuroses") if isinstance(given, vtkMultiBlockDataSet) else given
        object.__setattr__(self, "aponeuroses", tuple(sheets))

    def __repr__(self) -> str:
        areas = ", ".join(f"{area.role} on {area.bone}" for area in self.attachments) or "no attachments"
        fibres = "no fibres" if self.fibres is None else f"fibres {dict(self.fibres)}"
        return f"Muscle({self.surface.GetNumberOfCells()} triangles; {areas}; {fibres})"


@dataclass(frozen=True, eq=False)
class SceneData:
    """The fields of a :class:`vtkmuscle.Scene`, which documents and checks them."""

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
    files: Mapping[str, Path] = field(default_factory=dict)

    @property
    def millimetres(self) -> float:
        """Millimetres per unit of length."""
        return MILLIMETRES[self.units]

    def solver_of(self, muscle: str) -> dict[str, Any]:
        """Return the parameters of a muscle's deformer; its own override the scene's."""
        return {**self.solver, **self.muscles[muscle].solver}

    def fixing_of(self, muscle: str) -> dict[str, Any]:
        """Return the parameters of a muscle's FixedPointDetector; its own override the scene's."""
        return {**self.fixing, **self.muscles[muscle].fixing}

    def bones_data(self) -> vtkMultiBlockDataSet:
        """Return the bones at rest as the data set that filters take."""
        return multiblock_from(dict(self.bones))

    def attachments_data(self, muscle: str) -> vtkMultiBlockDataSet | None:
        """Return a muscle's attachments as the data set that filters take, None where it has none."""
        areas = self.muscles[muscle].attachments
        return attachments_from(areas) if areas else None

    def aponeuroses_data(self, muscle: str) -> vtkMultiBlockDataSet | None:
        """Return a muscle's aponeuroses as the data set that filters take, None where it has none."""
        sheets = self.muscles[muscle].aponeuroses
        return aponeuroses_data(sheets) if sheets else None


class Surface(NamedTuple):
    """A surface: points (n, 3), and triangles (m, 3) of point ids."""

    points: Floats
    triangles: Ints


@dataclass(frozen=True, eq=False)
class Anatomy:
    """The bones and muscles of a scene at rest, by their names."""

    bones: Mapping[str, Bone]
    muscles: Mapping[str, Surface]

    @classmethod
    def of(cls, scene: SceneData) -> Self:
        """Return the surfaces of a scene; raise a ValueError for one without triangles, or not finite."""
        bones = {name: bone_of(*checked_surface(bone, name)) for name, bone in scene.bones.items()}
        muscles = scene.muscles.items()
        return cls(bones, {name: Surface(*checked_surface(one.surface, name)) for name, one in muscles})

    @property
    def surfaces(self) -> dict[str, Bone | Surface]:
        """All surfaces, by their keys in a scene."""
        found: dict[str, Bone | Surface] = {f"bones.{name}.surface": one for name, one in self.bones.items()}
        return found | {f"muscles.{name}.surface": one for name, one in self.muscles.items()}

    @property
    def solid_bones(self) -> dict[str, Bone]:
        """The bones that have an inside, holes closed."""
        return {name: bone for name, bone in self.bones.items() if bone.solids.trees}
