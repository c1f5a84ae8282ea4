"""What a report is made of: a result of a run, as far as the page needs it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from vtkmuscle.core.estimate import Estimate
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.types import Floats
from vtkmuscle.data.drawn_bones import DrawnBones
from vtkmuscle.io.literature import LiteratureCurve


class RunResult(Protocol):
    """The part of :class:`vtkmuscle.Result` that a page is made of; this layer is below that class."""

    name: str
    units: str
    time_label: str
    motion: RigidMotion
    report: Mapping[str, Any]
    frames: Sequence[int]
    times: Sequence[float]
    muscle_names: Sequence[str]
    verdicts: Mapping[str, str]
    literature: Mapping[str, Sequence[LiteratureCurve]]
    drawn_bones: DrawnBones

    @property
    def lengths(self) -> Mapping[str, Floats]:
        """Per muscle the lengths of its paths [mm]."""

    @property
    def fibre_lengths(self) -> Mapping[str, Floats]:
        """Per muscle those of its fibres [mm]."""

    @property
    def has_moment_arms(self) -> bool:
        """Whether there are any."""

    @property
    def errors(self) -> Mapping[str, Mapping[str, Estimate]]:
        """Per muscle the quantities whose errors are known."""

    def finished(self, name: str, /) -> int:
        """Return how many of the kept frames a muscle has."""

    def moment_arms(self, *coordinates: str) -> Mapping[str, Mapping[str, JointArms]]:
        """Return the moment arms per muscle and coordinate."""

    def muscle(self, name: str, /, *, frame: int | None = None) -> Any:
        """Return a muscle in a kept frame."""

    def fibres(self, name: str, /, *, frame: int | None = None) -> Any:
        """Return the fibres of a muscle in a kept frame, None where it has none."""

    def rest_muscle(self, name: str, /) -> Any:
        """Return a muscle at rest."""

    def rest_bones(self) -> Any:
        """Return the bones at rest."""
