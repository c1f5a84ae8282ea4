"""What a result is as tables, and all that it has of one muscle."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import copy
from os import PathLike
from pathlib import Path
from typing import Any, Self, TypeVar

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.estimate import Estimate
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.moment_arms.of_joints import joint_arms
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.io.literature import curves_for, read_literature
from vtkmuscle.run.frames import KeptFrames
from vtkmuscle.run.report_values import architecture_table, fibre_table
from vtkmuscle.run.table import MomentArmTable, Table, length_table
from vtkmuscle.scene.data import MILLIMETRES


class ResultTables(KeptFrames):
    """Lengths, moment arms, architecture and checks of kept frames; see :class:`vtkmuscle.Result`."""

    def moment_arms(self, *coordinates: str) -> MomentArmTable:
        """Return the moment arms of all paths in the kept frames: the levers of their pulls.

        Parameters
        ----------
        *coordinates : str
            Names of coordinates of the motion; default: all that change, or whose joint is known.

        Returns
        -------
        MomentArmTable
            Per muscle and coordinate arms, -dl/dq beside them and a quartic fit [mm], see
            :class:`~vtkmuscle.core.moment_arms.of_joints.JointArms`; ``table()`` gives a table.

        Raises
        ------
        ValueError
            If no muscle has fibres, the motion has no such coordinate or none that changes, or the
            coordinates change together only, and their joints are not known.
        """
        if not self.lengths:
            raise InputError(
                "", "no muscle of the run has fibres, so there are no moment arms", "give it fibres"
            )
        if coordinates not in self._known_arms:
            self._known_arms[coordinates] = self._joint_arms(coordinates)
        arms, refused = self._known_arms[coordinates]
        return MomentArmTable(arms, refused, self.errors)

    def _joint_arms(
        self, coordinates: tuple[str, ...]
    ) -> tuple[dict[str, dict[str, JointArms]], dict[str, str]]:
        """Return the moment arms per muscle and coordinate, and why there are none by others."""
        motion = self.motion.part(self.frames)
        arms: dict[str, dict[str, JointArms]] = {}
        refused: dict[str, str] = {}
        problems: list[InputError] = []
        for name, lengths in self.lengths.items():
            if len(lengths) < len(self.frames):
                continue  # it failed on the way
            crossed = self.crosses.get(name)
            among = coordinates or tuple(motion.coordinates)
            if crossed is not None and not any(
                one in among and (motion.coordinates[one].changes or motion.coordinates[one].twists)
                for one in crossed
            ):
                continue  # it crosses none by which there are arms
            try:
                arms[name], without = joint_arms(
                    lengths,
                    self.wrenches(name),
                    motion,
                    coordinates or None,
                    crossed=crossed,
                    millimetres=MILLIMETRES[self.units],
                )
            except InputError as error:  # of this muscle alone, where others cross other coordinates
                problems.append(error)
                without = dict.fromkeys(crossed or among, str(error))
            refused |= without
        if problems and not arms:
            raise problems[0]
        return arms, refused

    def length_table(self) -> Table:
        """Return the lengths of the paths, a row per muscle, fibre and frame, as lengths.csv."""
        return length_table(self.lengths, self.errors, "each_length", self.frames, self.times)

    def fibre_length_table(self) -> Table:
        """Return the lengths of the fibres, a row per muscle, fibre and frame, as fibre_lengths.csv."""
        return length_table(self.fibre_lengths, self.errors, "each_fibre_length", self.frames, self.times)

    def frame_table(self) -> Table:
        """Return the figures of the report, a row per muscle and frame; NaN where a muscle has none.

        ``report["definitions"]`` says what they are. What is no number, as the measures of fibres, is left to
        the report.
        """
        muscles = self.report["muscles"]
        rows = [{"muscle": name, **row} for name in self.muscle_names for row in muscles[name]["frames"]]
        known = {
            key: None for row in rows for key, value in row.items() if not isinstance(value, dict | list)
        }
        return Table(tuple(known), ([row.get(key) for key in known] for row in rows))

    def architecture(self) -> Table:
        """Return the architecture of the muscles at rest, a row each, as architecture.csv has it.

        ``report["definitions"]`` says what the columns are.
        """
        return architecture_table(self.report["muscles"])

    def tables(self) -> dict[str, Table]:
        """Return the tables that a run writes, by their names: lengths, moment arms and architecture."""
        found = {"lengths": self.length_table(), "fibre_lengths": self.fibre_length_table()}
        if self.has_moment_arms:
            arms = self.moment_arms()
            found |= {"moment_arms": arms.table(), "moment_arms_summary": arms.summary()}
        return found | {"architecture": self.architecture()}

    def fibre_tables(self) -> Iterator[tuple[str, Table]]:
        """Give the measures of the fibres of each muscle that has some, a row per fibre and frame."""
        for name, track in self._tracks.items():
            if track.fibres:
                times = self.times[: len(track.fibres)]
                yield name, fibre_table(track.fibres, times, MILLIMETRES[self.units])

    def to_csv(self, folder: str | PathLike[str]) -> list[Path]:
        """Write the tables of the result: lengths, moment arms, architecture, and the checks by frame.

        Parameters
        ----------
        folder : path
            Made where it does not exist; files of the same names are replaced.

        Returns
        -------
        list of Path
            The .csv files, of those tables that there are.
        """
        Path(folder).mkdir(parents=True, exist_ok=True)
        tables = self.tables() | {"frames": self.frame_table()}
        return [table.to_csv(Path(folder) / f"{name}.csv") for name, table in tables.items()]

    def with_literature(self, path: str | PathLike[str]) -> Self:
        """Return the same result with published moment arms, which figures and the page then show.

        Parameters
        ----------
        path : path
            A table as :func:`vtkmuscle.io.read_literature` takes it; others stay as they are.

        Raises
        ------
        ValueError
            If it has none of the muscles of the result.
        """
        curves = read_literature(path)
        found = {name: mine for name in self.muscle_names if (mine := curves_for(curves, muscle=name))}
        if not found:
            theirs = ", ".join(sorted({curve.muscle for curve in curves}))
            raise InputError(
                str(path), "it has moment arms of none of the muscles", f"it has those of {theirs}"
            )
        other = copy(self)
        other.literature = {**self.literature, **found}
        return other

    def to_frame(self) -> Any:
        """Return the lengths of the paths for pandas, as ``length_table()`` has them.

        Raises
        ------
        ImportError
            If pandas is not installed; ``length_table()`` needs none.
        """
        return self.length_table().to_frame()


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
