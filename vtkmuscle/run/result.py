"""The result of a run, as a whole and by muscle.

A result has frames, tables, figures and a page.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeVar

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.by_coordinate import JointArms
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import suggestion
from vtkmuscle.run.limits import CHECKS
from vtkmuscle.run.result_data import ResultData
from vtkmuscle.run.store import ResultFolder
from vtkmuscle.run.verdict import VERDICTS

if TYPE_CHECKING:
    from vtkmuscle.report import RunContent

#: Muscles that are named one by one where a result is printed, at most.
_MOST_LISTED = 8


class Result(ResultData):
    """The muscles, fibres and bones of a run by frame.

    The report is part of the result. Frames of a run with a folder stay in the folder's files, and are read
    on demand; numbers are in memory.

    Parameters
    ----------
    bones : vtkMultiBlockDataSet
        The bones at rest.
    motion : RigidMotion
        Motion of the bones.
    tracks : dict of str to MuscleTrack
        The finished frames of each muscle.
    report : dict
        The report of the run; ``report["definitions"]`` defines each number.
    literature : mapping of str to sequence of LiteratureCurve, optional
        Published moment arms per muscle.
    crosses : mapping of str to sequence of str, optional
        Coordinates of the motion crossed by each muscle, if known.

    Attributes
    ----------
    report, motion, literature, crosses
        As given.
    name, units : str
        Name and unit of the scene; all coordinates are in the unit.
    frames : list of int
        Numbers of the kept frames in the motion, counted from 0.
    times : list of float
        Pipeline times of the kept frames.
    time_label : str
        Label of the times: a coordinate with a unit if the times are a coordinate.
    muscle_names : list of str
        In the order of the scene.
    verdicts : dict of str to str
        Of each muscle ``"ok"``, ``"look"`` or ``"failed"``; the reasons are in
        ``report["muscles"][NAME]["verdict"]``.
    lengths : dict of str to (frames, fibres) array
        Of the paths of muscles with fibres [mm]: musculotendon lengths, bone to bone; a row per
        finished frame. A path and the path's fibre share a number.
    fibre_lengths : dict of str to (frames, fibres) array
        Of the fibres [mm]; a row per finished frame.

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
    Table: 24 rows of muscle, fibre, frame, time, length_mm, segment_error_mm
    >>> table.where(frame=2)["length_mm"].shape
    (8,)
    >>> result.frame_table().where(muscle="spindle")["volume_ratio"].round(6)
    array([1., 1., 1.])
    """

    @classmethod
    def load(cls, folder: str | PathLike[str]) -> Self:
        """Read the result of a finished run from a folder.

        Parameters
        ----------
        folder : path
            The ``out`` of :meth:`vtkmuscle.Scene.run`, or the ``--out`` of ``vtkmuscle run``.

        Returns
        -------
        Result
            Equal to the run's result. All files are checked; frames are read at first access.

        Raises
        ------
        ValueError
            If the folder is not the folder of a run, the run did not end, or a file is missing or changed
            since the run; the message names the fault.

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
        """Return a muscle of the result.

        As in ``result["iliacus"].fibre_lengths``.
        """
        return MuscleResult(self, name)

    @property
    def muscles(self) -> dict[str, MuscleResult]:
        """The muscles of the result by name."""
        return {name: self[name] for name in self.muscle_names}

    def __repr__(self) -> str:
        verdicts = list(self.verdicts.values())
        muscles = ", ".join(f"{name} ({self.verdicts[name]})" for name in self.muscle_names)
        if len(verdicts) > _MOST_LISTED:
            counts = ", ".join(f"{verdicts.count(one)} {one}" for one in VERDICTS if one in verdicts)
            muscles = f"{len(verdicts)} muscles ({counts})"
        return f"Result({self.name!r}: {len(self.times)} frames of {muscles})"

    def plot(
        self,
        *,
        frame: int | None = None,
        time: float | None = None,
        muscles: str | Sequence[str] | None = None,
        show: bool = True,
        off_screen: bool | None = None,
    ) -> Any:
        """Show the scene in a window or notebook cell.

        Parameters
        ----------
        frame, time : int, float, optional
            Number or time of a kept frame; by default a slider goes through all kept frames.
        muscles : str or sequence of str, optional
            Muscles to show; default all.
        show : bool, optional
            False to get the plotter before showing, for additions or captures.
        off_screen : bool, optional
            Draw without a window; PyVista's own setting by default.

        Returns
        -------
        pyvista.Plotter or None
            The plotter with ``show=False``.

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
            A .gif or an .mp4; an existing file is replaced. An .mp4 needs the extra ``movie``.
        fps : float, optional
            Frames per second.
        muscles : str or sequence of str, optional
            Muscles to show; default all.
        size : (int, int), optional
            Width and height [pixels], even numbers.

        Raises
        ------
        ValueError
            For another suffix, rate or size, or if there is no such muscle.
        ImportError
            For an .mp4 without the extra.
        RuntimeError
            If no picture can be rendered here.
        """
        from vtkmuscle.run.display import film_of  # noqa: PLC0415 -- only pictures need PyVista

        return film_of(self, Path(path), fps=fps, muscles=muscles, size=size)

    def write_figures(
        self, folder: str | PathLike[str], *, form: str = "png", dpi: float = 150.0
    ) -> list[Path]:
        """Draw the figures of a run again.

        Rest pose, muscles, lengths and moment arms.

        Parameters
        ----------
        folder : path
            Created if missing.
        form : str, optional
            ``"png"``; or ``"pdf"`` or ``"svg"`` with curves and letters as vector graphics.
        dpi : float, optional
            Pixels per inch of pictures, 20 to 2400; the size on paper stays.

        Returns
        -------
        list of Path
            ``rest_pose.png``, per muscle ``NAME_frames.png`` and with fibres ``NAME_lengths.png`` of the
            paths, ``NAME_fibre_lengths.png``, and with moment arms ``NAME_moment_arms.png``.

        Raises
        ------
        ValueError
            For another form or resolution.
        RuntimeError
            If no picture can be rendered here; then no file is written.
        """
        from vtkmuscle.run.figures import write_figures  # noqa: PLC0415 -- only figures need PyVista

        return write_figures(Path(folder), self.plain(), form=form, dpi=dpi)

    def write_report(self, path: str | PathLike[str]) -> Path:
        """Write the page of the run.

        The page has the scene to turn and move, curves, tables and verdicts.

        Parameters
        ----------
        path : path
            The .html file; an existing file is replaced. The file is complete and needs no network.

        Raises
        ------
        ValueError
            If the name does not end in .html.
        """
        from vtkmuscle.report import write_page  # noqa: PLC0415 -- only a page needs its parts

        if Path(path).suffix.lower() not in (".html", ".htm"):
            raise InputError(str(path), "a report is a page of HTML", "give it a name that ends in .html")
        return write_page(path, self._content())

    def _content(self) -> RunContent:
        """Return the content of the page."""
        from vtkmuscle.report import MuscleContent, RunContent  # noqa: PLC0415

        arms = self.moment_arms() if self.has_moment_arms else {}
        muscles = {
            name: MuscleContent(
                rest=self.plain().rest_muscle(name),
                surfaces=track.surfaces,
                fibres=track.fibres,
                lengths=self.lengths.get(name),
                fibre_lengths=self.fibre_lengths.get(name),
                arms=arms.get(name, {}),
                literature=self.literature.get(name, ()),
            )
            for name, track in self._tracks.items()
        }
        return RunContent(
            report=self.report,
            motion=self.motion,
            bones=self.drawn_bones,
            frames=self.frames,
            times=self.times,
            time_label=self.time_label,
            muscles=muscles,
            limits={name: (check.look, check.failed) for name, check in CHECKS.items()},
        )


One = TypeVar("One")


class MuscleResult:
    """A muscle of a result: ``result["iliacus"]``.

    Parameters
    ----------
    result : Result
        The result of all muscles.
    name : str
        Name of the muscle.

    Attributes
    ----------
    name, verdict : str
        Name of the muscle, and ``"ok"``, ``"look"`` or ``"failed"``.
    reasons : tuple of str
        Reasons of a verdict other than ok.
    lengths, fibre_lengths : (frames, fibres) array
        Of the paths and of the fibres [mm].
    moment_arms : mapping of str to JointArms
        By coordinate.
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

    def __init__(self, result: Result, name: str) -> None:
        if name not in result.muscle_names:
            known = suggestion(name, result.muscle_names) if isinstance(name, str) else "give a muscle's name"
            raise InputError("", f"there is no muscle {name!r} in the result", known)
        self._result, self.name = result, name
        self.verdict = result.verdicts[name]
        self.reasons = tuple(one["says"] for one in result.report["muscles"][name]["verdict"]["reasons"])

    @property
    def lengths(self) -> Floats:
        """Lengths of the paths [mm]."""
        return self._of(self._result.lengths, "paths")

    @property
    def fibre_lengths(self) -> Floats:
        """Lengths of the fibres [mm]."""
        return self._of(self._result.fibre_lengths, "fibres")

    @property
    def moment_arms(self) -> Mapping[str, JointArms]:
        """Moment arms by coordinate."""
        return self._result.moment_arms()[self.name]

    @property
    def architecture(self) -> Mapping[str, Any]:
        """Architecture at rest, by the report's definitions."""
        muscles = self._result.report["muscles"]
        return self._of({self.name: muscles[self.name].get("architecture")}, "fibres")

    def surface(self, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return the surface in a kept frame.

        As ``result.muscle(name, frame=...)``.
        """
        return self._result.muscle(self.name, frame=frame, time=time)

    def fibres(self, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return the fibres in a kept frame.

        As ``result.fibres(name, frame=...)``.
        """
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
