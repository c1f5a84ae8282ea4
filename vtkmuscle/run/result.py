"""What a run of a scene gives back."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import smoothed_curve
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.moment_arms.of_joints import joint_arms
from vtkmuscle.run.frames import KeptFrames
from vtkmuscle.run.limits import CHECKS
from vtkmuscle.run.store import ResultFolder
from vtkmuscle.run.table import MomentArmTable, Table, length_table
from vtkmuscle.run.verdict import VERDICTS
from vtkmuscle.scene.data import MILLIMETRES

Floats = NDArray[np.float64]

#: Muscles that are named one by one where a result is printed, at most.
_MOST_LISTED = 8


class Result(KeptFrames):
    """The muscles, fibres and bones of a run, frame by frame, and its report.

    Parameters
    ----------
    bones : vtkMultiBlockDataSet
        The bones at rest.
    motion : RigidMotion
        How they move.
    tracks : dict of str to MuscleTrack
        The finished frames of each muscle.
    report : dict
        What was run and measured; ``report["definitions"]`` says what each number means.
    literature : mapping of str to sequence of LiteratureCurve, optional
        Published moment arms per muscle.
    crosses : mapping of str to sequence of str, optional
        Coordinates of the motion that each muscle crosses, where that is known.

    Attributes
    ----------
    report, motion, literature, crosses
        As given.
    name, units : str
        Of the scene; the unit is that of all coordinates.
    frames : list of int
        Numbers of the kept frames in the motion, counted from 0.
    times : list of float
        Their pipeline times.
    time_label : str
        What these are: a coordinate with its unit, where they are one.
    muscle_names : list of str
        In the order of the scene.
    verdicts : dict of str to str
        Of each muscle ``"ok"``, ``"look"`` or ``"failed"``; ``report["muscles"][NAME]["verdict"]`` says why.
    lengths : dict of str to (frames, fibres) array
        Of the paths of the muscles that have fibres [mm]: musculotendon lengths, bone to bone; a row per
        finished frame. A path has the number of its fibre.
    fibre_lengths : dict of str to (frames, fibres) array
        Of the fibres themselves, likewise.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> result = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8).run(frames="0:3")
    >>> result
    Result('spindle_over_hinge': 3 frames of spindle (ok))

    By muscle, and by frame or time; surfaces and fibres are PyVista's:

    >>> result.lengths["spindle"].shape
    (3, 8)
    >>> result.muscle("spindle", time=result.times[1]).plot()  # doctest: +SKIP
    >>> result.fibres("spindle", frame=2).n_cells
    8

    As tables, which ``to_frame()`` gives to pandas:

    >>> table = result.length_table()
    >>> table
    Table: 24 rows of muscle, fibre, frame, time, length_mm, length_err_mm
    >>> table.where(frame=2)["length_mm"].shape
    (8,)
    >>> result.frame_table().where(muscle="spindle")["volume_ratio"].round(6)
    array([1., 1., 1.])
    """

    @classmethod
    def load(cls, folder: str | PathLike[str]) -> Self:
        """Read the result of a finished run back from its folder.

        Parameters
        ----------
        folder : path
            What was given to :meth:`vtkmuscle.Scene.run` as ``out``, or to ``vtkmuscle run`` as ``--out``.

        Returns
        -------
        Result
            The same as the run gave: muscles, fibres, lengths, bones, motion, report and verdicts. All files
            are checked; the frames of a muscle are read when they are first asked for.

        Raises
        ------
        ValueError
            If it is not the folder of a run, the run did not end, or a file in it is missing or is not what
            the run wrote; the message says which.

        Examples
        --------
        >>> from tempfile import mkdtemp
        >>> from vtkmuscle import Result, Scene, phantoms
        >>> scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)
        >>> out = mkdtemp()
        >>> result = scene.run(out, frames="0:2", figures=False)
        >>> Result.load(out)
        Result('spindle_over_hinge': 2 frames of spindle (ok))
        """
        return cls(**ResultFolder(Path(folder)).result())

    def __repr__(self) -> str:
        verdicts = list(self.verdicts.values())
        muscles = ", ".join(f"{name} ({self.verdicts[name]})" for name in self.muscle_names)
        if len(verdicts) > _MOST_LISTED:
            counts = ", ".join(f"{verdicts.count(one)} {one}" for one in VERDICTS if one in verdicts)
            muscles = f"{len(verdicts)} muscles ({counts})"
        return f"Result({self.name!r}: {len(self.times)} frames of {muscles})"

    def smoothed_lengths(self, *, passes: int = 5) -> dict[str, Floats]:
        """Return the lengths of the paths without their noise over the frames.

        Parameters
        ----------
        passes : int, optional
            How often l_i becomes (l_{i-1} + 4 l_i + l_{i+1}) / 6, the ends kept; Kohout and Cervenka 2021,
            section 4.4, has five.

        Returns
        -------
        dict of str to (frames, fibres) array
            As ``lengths`` [mm].
        """
        return {name: smoothed_curve(lengths, passes=passes) for name, lengths in self.lengths.items()}

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

    def to_frame(self) -> Any:
        """Return the lengths of the paths for pandas, as ``length_table()`` has them.

        Raises
        ------
        ImportError
            If pandas is not installed; ``length_table()`` needs none.
        """
        return self.length_table().to_frame()

    def plot(
        self,
        *,
        frame: int | None = None,
        time: float | None = None,
        muscles: Sequence[str] | None = None,
        show: bool = True,
        off_screen: bool | None = None,
    ) -> Any:
        """Show the scene in a window, or in a cell of a notebook.

        Parameters
        ----------
        frame, time : int, float, optional
            Of one kept frame; without either, a slider goes through all of them.
        muscles : sequence of str, optional
            Which to show; default all.
        show : bool, optional
            False to get the plotter before it is shown, to add to it or to capture it.
        off_screen : bool, optional
            Draw without a window; PyVista's own setting by default.

        Returns
        -------
        pyvista.Plotter or None
            With the scene on it, where it is not shown; None once it is.

        Raises
        ------
        ValueError
            If there is no such muscle or kept frame.
        """
        from vtkmuscle.run.display import ResultDisplay  # noqa: PLC0415 -- only pictures need PyVista

        position = 0 if frame is None and time is None else self._position(frame, time)
        shown = ResultDisplay(self, muscles, off_screen=off_screen)
        shown.show(position)
        if frame is None and time is None and len(self.frames) > 1:
            shown.add_slider()
        if not show:
            return shown.scene.plotter
        shown.scene.plotter.show()
        return None

    def movie(
        self,
        path: str | PathLike[str],
        *,
        fps: float = 15.0,
        muscles: Sequence[str] | None = None,
        size: tuple[int, int] = (1024, 768),
    ) -> Path:
        """Write a film of all kept frames.

        Parameters
        ----------
        path : path
            A .gif, or an .mp4, which needs the extra ``movie``; replaced where it exists.
        fps : float, optional
            Frames per second.
        muscles : sequence of str, optional
            Which to show; default all.
        size : (int, int), optional
            Width and height [pixels], even numbers.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        ValueError
            For another suffix, rate or size, or if there is no such muscle.
        ImportError
            For an .mp4 without the extra.
        RuntimeError
            If no picture can be rendered here.
        """
        from vtkmuscle.plotting import can_render, check_movie, write_movie  # noqa: PLC0415 -- need PyVista
        from vtkmuscle.run.display import ResultDisplay  # noqa: PLC0415

        file = check_movie(path, fps)
        if any(side < 2 or side % 2 for side in size):
            raise InputError("", f"size is {size}, but must be two even numbers of pixels, e.g. (1024, 768)")
        reason = can_render()
        if reason is not None:
            raise RuntimeError(f"no film can be made: {reason}")
        shown = ResultDisplay(self, muscles, off_screen=True, size=size)
        try:
            return write_movie(file, shown.pictures(), fps=fps)
        finally:
            shown.scene.plotter.close()

    def write_figures(self, folder: str | PathLike[str]) -> list[Path]:
        """Draw the figures of a run again: rest pose, muscles, lengths, moment arms, volumes.

        Parameters
        ----------
        folder : path
            Made where it does not exist.

        Returns
        -------
        list of Path
            The .png files.

        Raises
        ------
        RuntimeError
            If no picture can be rendered here.
        """
        from vtkmuscle.run.figures import write_figures  # noqa: PLC0415 -- only figures need PyVista

        return write_figures(Path(folder), self.plain())

    def write_report(self, path: str | PathLike[str]) -> Path:
        """Write the page of the run: the scene to be turned and moved, curves, tables and verdicts.

        Parameters
        ----------
        path : path
            The .html file; replaced where it exists. It holds all that it shows and needs no network.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        ValueError
            If the name does not end in .html.
        """
        from vtkmuscle.report import write_page  # noqa: PLC0415 -- only a page needs its parts

        if Path(path).suffix.lower() not in (".html", ".htm"):
            raise InputError(str(path), "a report is a page of HTML", "give it a name that ends in .html")
        return write_page(path, self.plain(), CHECKS)
