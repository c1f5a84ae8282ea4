"""All that a result has of one muscle."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from vtkmuscle.core.accuracy.estimate import Estimate
from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.run.result_tables import ResultTables

One = TypeVar("One")


class MuscleResult:
    """One muscle of a result, as ``result["iliacus"]`` gives it.

    Parameters
    ----------
    result : Result
        Of all muscles.
    name : str
        Of this one.

    Attributes
    ----------
    name, verdict : str
        Its name, and ``"ok"``, ``"look"`` or ``"failed"``.
    reasons : tuple of str
        Why it is not ok.
    lengths, fibre_lengths : (frames, fibres) array
        Of its paths and of its fibres [mm].
    moment_arms : mapping of str to JointArms
        By coordinate.
    errors : mapping of str to Estimate
        What is known of the errors of its numbers.
    architecture : mapping of str to object
        At rest, by the names of ``report["definitions"]``.

    Raises
    ------
    ValueError
        If there is no such muscle.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> result = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8).run(frames="0:2")
    >>> result["spindle"].verdict, result["spindle"].lengths.shape
    ('ok', (2, 8))
    >>> result["spindle"].architecture["pcsa_mm2"] > 0.0
    True
    """

    def __init__(self, result: ResultTables, name: str) -> None:
        if name not in result.muscle_names:
            known = suggestion(name, result.muscle_names) if isinstance(name, str) else "give a muscle's name"
            raise InputError("", f"there is no muscle {name!r} in the result", known)
        self._result, self.name = result, name
        self.verdict = result.verdicts[name]
        self.reasons = tuple(one["says"] for one in result.report["muscles"][name]["verdict"]["reasons"])

    @property
    def lengths(self) -> Floats:
        """Of its paths [mm]."""
        return self._of(self._result.lengths, "paths")

    @property
    def fibre_lengths(self) -> Floats:
        """Of its fibres [mm]."""
        return self._of(self._result.fibre_lengths, "fibres")

    @property
    def moment_arms(self) -> Mapping[str, JointArms]:
        """By coordinate."""
        return self._result.moment_arms()[self.name]

    @property
    def errors(self) -> Mapping[str, Estimate]:
        """What is known of the errors of its numbers."""
        return self._result.errors[self.name]

    @property
    def architecture(self) -> Mapping[str, Any]:
        """At rest, by the names of the report's definitions."""
        muscles = self._result.report["muscles"]
        return self._of({self.name: muscles[self.name].get("architecture")}, "fibres")

    def surface(self, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return its surface in a kept frame, as ``result.muscle(name, frame=...)``."""
        return self._result.muscle(self.name, frame=frame, time=time)

    def fibres(self, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return its fibres in a kept frame, as ``result.fibres(name, frame=...)``."""
        return self._result.fibres(self.name, frame=frame, time=time)

    def __repr__(self) -> str:
        known = self._result.fibre_lengths.get(self.name)
        words = ""
        if known is not None:
            mean = known.mean(axis=1)
            words = f"; {known.shape[1]} fibres, {mean.min():.1f} to {mean.max():.1f} mm"
        return f"MuscleResult({self.name!r}: {self.verdict}{words})"

    def _of(self, known: Mapping[str, One], what: str) -> One:
        found = known.get(self.name)
        if found is None:
            raise InputError("", f"{self.name!r} has no {what}", "give it fibres")
        return found
