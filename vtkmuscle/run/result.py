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
from vtkmuscle.run.limits import CHECKS
from vtkmuscle.run.result_tables import MuscleResult, ResultTables
from vtkmuscle.run.store import ResultFolder
from vtkmuscle.run.verdict import VERDICTS

Floats = NDArray[np.float64]

#: Muscles that are named one by one where a result is printed, at most.
_MOST_LISTED = 8


class Result(ResultTables):
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

    def __getitem__(self, name: str) -> MuscleResult:
        """Return all that there is of one muscle: ``result["iliacus"].fibre_lengths``."""
        return MuscleResult(self, name)

    @property
    def muscles(self) -> dict[str, MuscleResult]:
        """Per muscle all that there is of it."""
        return {name: self[name] for name in self.muscle_names}

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

    def plot(
        self,
        *,
        frame: int | None = None,
        time: float | None = None,
        muscles: str | Sequence[str] | None = None,
        show: bool = True,
        off_screen: bool | None = None,
    ) -> Any:
        """Show the scene in a window, or in a cell of a notebook.

        Parameters
        ----------
        frame, time : int, float, optional
            Of one kept frame; without either, a slider goes through all of them.
        muscles : str or sequence of str, optional
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
        muscles: str | Sequence[str] | None = None,
        size: tuple[int, int] = (1024, 768),
    ) -> Path:
        """Write a film of all kept frames.

        Parameters
        ----------
        path : path
            A .gif, or an .mp4, which needs the extra ``movie``; replaced where it exists.
        fps : float, optional
            Frames per second.
        muscles : str or sequence of str, optional
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
        from vtkmuscle.plotting import can_render  # noqa: PLC0415 -- only pictures need PyVista
        from vtkmuscle.run.display import ResultDisplay, check_movie, write_movie  # noqa: PLC0415

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

    def write_figures(
        self, folder: str | PathLike[str], *, form: str = "png", dpi: float = 150.0
    ) -> list[Path]:
        """Draw the figures of a run again: rest pose, muscles, lengths, moment arms.

        Parameters
        ----------
        folder : path
            Made where it does not exist.
        form : str, optional
            ``"png"``; or ``"pdf"`` or ``"svg"``, in which curves and letters are drawn as such.
        dpi : float, optional
            Pixels per inch of what is a picture; the size on paper stays.

        Returns
        -------
        list of Path
            The files.

        Raises
        ------
        ValueError
            For another form, or pixels that are not 20 to 2400 to an inch.
        RuntimeError
            If no picture can be rendered here.
        """
        from vtkmuscle.run.figures import write_figures  # noqa: PLC0415 -- only figures need PyVista

        return write_figures(Path(folder), self.plain(), form=form, dpi=dpi)

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
