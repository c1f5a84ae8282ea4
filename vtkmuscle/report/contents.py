"""Content of a run's page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.drawn_bones import DrawnBones
from vtkmuscle.io.literature import LiteratureCurve


@dataclass(frozen=True, eq=False, kw_only=True)
class MuscleContent:
    """A muscle on a page.

    Attributes
    ----------
    rest : vtkPolyData
        Surface at rest.
    surfaces, fibres : sequence of vtkPolyData
        Surface and fibres in each finished frame; possibly empty.
    lengths, fibre_lengths : (f, k) array or None
        Lengths of paths and of fibres in each finished frame [mm].
    arms : mapping of str to JointArms
        By coordinate.
    literature : sequence of LiteratureCurve
        Published moment arms.
    """

    rest: vtkPolyData
    surfaces: Sequence[vtkPolyData] = ()
    fibres: Sequence[vtkPolyData] = ()
    lengths: Floats | None = None
    fibre_lengths: Floats | None = None
    arms: Mapping[str, JointArms]
    literature: Sequence[LiteratureCurve] = ()


@dataclass(frozen=True, eq=False, kw_only=True)
class RunContent:
    """A run on a page.

    Attributes
    ----------
    report : mapping
        Report of the run.
    motion : RigidMotion
        Motion of the bones.
    bones : DrawnBones
        Bones at rest.
    frames, times : sequence of int, sequence of float
        Numbers and pipeline times of the kept frames.
    time_label : str
        Label of the times, with the unit in brackets.
    muscles : mapping of str to MuscleContent
        In the order of the scene.
    limits : mapping of str to (float, float)
        By check: the limits of the verdicts ``"look"`` and ``"failed"``.
    """

    report: Mapping[str, Any]
    motion: RigidMotion
    bones: DrawnBones
    frames: Sequence[int]
    times: Sequence[float]
    time_label: str
    muscles: Mapping[str, MuscleContent]
    limits: Mapping[str, tuple[float, float]]

    def finished(self, name: str) -> int:
        """Return the number of finished frames of a muscle."""
        return len(self.report["muscles"][name]["frames"])

    def verdict(self, name: str) -> str:
        """Return the verdict on a muscle: ``"ok"``, ``"look"`` or ``"failed"``."""
        return str(self.report["muscles"][name]["verdict"]["verdict"])
