"""What a result is as tables."""

from __future__ import annotations

from copy import copy
from os import PathLike
from pathlib import Path
from typing import Any, Self

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.moment_arms.of_joints import joint_arms
from vtkmuscle.io.literature import curves_for, read_literature
from vtkmuscle.run.architecture import architecture_table
from vtkmuscle.run.frames import KeptFrames
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
            :class:`~vtkmuscle.core.moment_arms.by_coordinate.JointArms`; ``table()`` gives a table.

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
        tables = {"lengths": self.length_table(), "fibre_lengths": self.fibre_length_table()}
        if any(one.get("moment_arms") for one in self.report["muscles"].values()):
            tables |= {
                "moment_arms": (arms := self.moment_arms()).table(),
                "moment_arms_summary": arms.summary(),
            }
        tables |= {"architecture": self.architecture(), "frames": self.frame_table()}
        Path(folder).mkdir(parents=True, exist_ok=True)
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
