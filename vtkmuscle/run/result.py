"""The result of a run: its frames, tables, figures and page, as a whole and by muscle."""

from collections.abc import Mapping, Sequence
from contextlib import closing
from html import escape
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.moment_arms.of_joints import JointArms
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import MOST_LISTED, Remedies
from vtkmuscle.io.writing import replacing, write_text
from vtkmuscle.plotting.drawing import can_render, html_picture
from vtkmuscle.run.figures import FORMS, ResultDisplay, draw_all, figures_of_muscle, rest_pose_of
from vtkmuscle.run.result_data import ResultData
from vtkmuscle.run.store import ResultFolder
from vtkmuscle.run.table import html_table
from vtkmuscle.run.verdict import CHECKS, VERDICTS


class Result(ResultData):
    """The muscles, fibres and bones of a run, frame by frame, and its report.

    :meth:`vtkmuscle.Scene.run` and :meth:`load` make it. Frames of a run that wrote to a folder stay in its
    files, and are read when they are asked for; numbers are in memory.

    Attributes
    ----------
    name, units : str
        Of the scene; the unit is that of all coordinates.
    report : dict
        The report of the run; ``report["definitions"]`` says what each number means.
    motion : RigidMotion
        How the bones move.
    frames, times : list of int, list of float
        Numbers of the kept frames in the motion, counted from 0, and their pipeline times.
    time_label : str
        The label of the times: a coordinate with its unit where they are one.
    muscle_names : list of str
        In the order of the scene.
    verdicts : dict of str to str
        Of each muscle ``"ok"``, ``"look"`` or ``"failed"``; ``report["muscles"][NAME]["verdict"]`` says why.
    lengths, fibre_lengths : dict of str to (frames, fibres) array
        Musculotendon lengths of the paths, bone to bone, and lengths of the fibres [mm]; a row per finished
        frame. A path has the number of its fibre.
    literature, crosses : dict of str to sequence
        Published moment arms per muscle, and the coordinates that it crosses, where that is known.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> result = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8).run(frames="0:3")
    >>> result
    Result('spindle_over_hinge': 3 frames of spindle (ok))

    By muscle, and by frame or time; surfaces and fibres are PyVista's:

    >>> result.lengths["spindle"].shape
    (3, 8)
    >>> result.fibres("spindle", frame=2).n_cells
    8

    As tables, which ``to_frame()`` gives to pandas:

    >>> result.length_table().where(frame=2)["length_mm"].shape
    (8,)
    >>> result.frame_table().where(muscle="spindle")["volume_ratio"].round(6)
    array([1., 1., 1.])
    """

    #: Limits of the verdicts look and failed, by check.
    limits: ClassVar = {name: (check.look, check.failed) for name, check in CHECKS.items()}

    @classmethod
    def load(cls, folder: str | PathLike[str]) -> Self:
        """Read the result of a finished run back from its folder, the ``out`` of the run.

        All files are checked; frames are read when they are first asked for.

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

    def keys(self) -> list[str]:
        """Return the names of the muscles, over which a result iterates."""
        return list(self.muscle_names)

    def __getitem__(self, name: str) -> "MuscleResult":
        """Return one muscle of the result: ``result["iliacus"].fibre_lengths``."""
        return MuscleResult(self, name)

    @property
    def muscles(self) -> dict[str, "MuscleResult"]:
        """The muscles of the result by name."""
        return dict(self.items())

    def __repr__(self) -> str:
        verdicts = list(self.verdicts.values())
        muscles = ", ".join(f"{name} ({self.verdicts[name]})" for name in self.muscle_names)
        if len(verdicts) > MOST_LISTED:
            counts = ", ".join(f"{verdicts.count(each)} {each}" for each in VERDICTS if each in verdicts)
            muscles = f"{len(verdicts)} muscles ({counts})"
        return f"Result({self.name!r}: {len(self.times)} frame{'s' * (len(self.times) != 1)} of {muscles})"

    def _repr_html_(self) -> str:
        rows = [(name, muscle.verdict, "; ".join(muscle.reasons)) for name, muscle in self.items()]
        picture = html_picture(lambda: self.plot(frame=self.frames[-1], show=False, off_screen=True))
        return f"<p>{escape(repr(self))}</p>" + html_table(("muscle", "verdict", "reasons"), rows) + picture

    def plot(
        self, *, frame: int | None = None, time: float | None = None,
        muscles: str | Sequence[str] | None = None, show: bool = True, off_screen: bool | None = None,
    ) -> Any:  # fmt: skip
        """Show the scene in a window, or in a cell of a notebook.

        A kept frame by number or time; without either, a slider goes through all of them. ``muscles`` are
        shown, default all. With ``show=False`` the plotter is returned before it is shown, to add to it or to
        capture it; ``off_screen`` is PyVista's own setting by default. ValueError if there is no such muscle
        or kept frame.
        """
        position = 0 if frame is None and time is None else self._position(frame, time)
        shown = ResultDisplay(self, muscles, off_screen=off_screen)
        shown.show(position)
        if frame is None and time is None and len(self.frames) > 1:
            shown.add_slider()
        return shown.scene.plotter.show() if show else shown.scene.plotter

    def movie(
        self, path: str | PathLike[str], *, fps: float = 15.0, muscles: str | Sequence[str] | None = None,
        size: tuple[int, int] = (1024, 768),
    ) -> Path:  # fmt: skip
        """Write a film of all kept frames.

        Parameters
        ----------
        path : path
            A .gif; replaced where it exists.
        fps : float, optional
            Frames per second.
        muscles : str or sequence of str, optional
            Which to show; default all.
        size : (int, int), optional
            Width and height [pixels].

        Raises
        ------
        ValueError
            For another suffix, rate or size, or if there is no such muscle.
        RuntimeError
            If no picture can be rendered here.
        """
        from PIL import Image  # noqa: PLC0415 -- matplotlib has it; only films need it

        if Path(path).suffix.lower() != ".gif":
            raise InputError(str(path), "a film is a .gif", "give it this suffix")
        if not fps > 0:
            raise InputError("", f"fps is {fps}, but must be a number > 0")
        if min(size) < 1:
            raise InputError("", f"size is {size}, but must be two numbers of pixels, e.g. (1024, 768)")
        if (reason := can_render()) is not None:
            raise RuntimeError(f"no film can be made: {reason}")
        shown = ResultDisplay(self, muscles, off_screen=True, size=size)
        with closing(shown.scene.plotter), replacing(Path(path)) as file:
            # One palette for all: colours that change from picture to picture flicker.
            first, *further = (Image.fromarray(picture).quantize(128) for picture in shown.pictures())
            pause = round(1000 / fps)
            first.save(file, format="GIF", save_all=True, append_images=further, duration=pause, loop=0)
        return Path(path)

    def write_figures(
        self, folder: str | PathLike[str], *, form: str = "png", dpi: float = 300.0, width: float = 180.0
    ) -> list[Path]:
        """Draw the figures of a run again, and return the files.

        Parameters
        ----------
        folder : path
            Made where it does not exist.
        form : str, optional
            ``"png"``; or ``"pdf"`` or ``"svg"``, in which curves and letters are drawn as such.
        dpi : float, optional
            Pixels per inch of pictures, 20 to 2400; their size on paper stays.
        width : float, optional
            Of the figures on paper, 60 to 400 [mm]; letters have 8 points. Journals have columns of about 85
            and 180 mm.

        Raises
        ------
        ValueError
            For another form, resolution or width.
        RuntimeError
            If no picture can be rendered here; nothing is written then.
        """
        if form not in FORMS:
            raise InputError(form, "unknown format of figures", "allowed: png, pdf, svg")
        if not 20.0 <= dpi <= 2400.0:
            raise InputError("", f"dpi is {dpi:g}, but must be 20 to 2400", "e.g. 300")
        if not 60.0 <= width <= 400.0:
            problem = f"width is {width:g} mm, but must be 60 to 400"
            raise InputError("", problem, "journals have columns of 85 and 180")
        if (reason := can_render()) is not None:
            raise RuntimeError(f"no figures can be made: {reason}")
        every = [rest_pose_of(self)]
        for name in self.muscle_names:
            every += figures_of_muscle(self, name)
        return draw_all(every, Path(folder), self.drawn_bones, form, dpi=dpi, width=width)

    def write_usd(self, path: str | PathLike[str], *, tubes: bool = False) -> Path:
        """Write bones, muscles and fibres as an animation of USD, for Blender, Houdini or Omniverse.

        A frame of the run is a frame of the animation. Muscles and bones have their colours of figures,
        fibres the colours of their change of length. The file is replaced where it exists.

        Parameters
        ----------
        path : path
            A .usd, .usdc (binary) or .usda (text) file.
        tubes : bool
            Fibres as meshes of tubes, for programs that do not draw curves.

        Raises
        ------
        ValueError
            For another suffix.
        ImportError
            Without the package usd-core.
        """
        from vtkmuscle.run.animation import write_usd  # noqa: PLC0415 -- an extra

        write_usd(self, Path(path), tubes=tubes)
        return Path(path)

    def write_report(self, path: str | PathLike[str]) -> Path:
        """Write the page of the run: the scene to be turned and moved, curves, tables and verdicts.

        The .html file holds all that it shows and needs no network; it is replaced where it exists. Another
        suffix is a ValueError.
        """
        from vtkmuscle.report import page_of  # noqa: PLC0415 -- only a page needs its parts

        if Path(path).suffix.lower() not in (".html", ".htm"):
            raise InputError(str(path), "a report is an HTML page", "end the name in .html")
        write_text(Path(path), page_of(self))
        return Path(path)


One = TypeVar("One")


class MuscleResult(Remedies):
    """One muscle of a result, as ``result["iliacus"]`` gives it; ValueError if there is no such muscle.

    Attributes
    ----------
    name, verdict : str
        Its name, and ``"ok"``, ``"look"`` or ``"failed"``.
    reasons : tuple of str
        Why it is not ok.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> result = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8).run(frames="0:2")
    >>> result["spindle"].verdict, result["spindle"].lengths.shape
    ('ok', (2, 8))
    """

    def __init__(self, result: Result, name: str) -> None:
        result.track(name)  # ValueError for an unknown name
        self._result, self.name, self.verdict = result, name, result.verdicts[name]
        self.reasons = tuple(each["says"] for each in result.report["muscles"][name]["verdict"]["reasons"])

    @property
    def volume(self) -> float:
        """Volume of the surface at rest [mm^3]."""
        return float(self._result.report["muscles"][self.name]["volume_mm3"])

    @property
    def length(self) -> Floats:
        """Mean of the paths' lengths (frames,) [mm]."""
        return np.asarray(self.lengths.mean(axis=1))

    @property
    def lengths(self) -> Floats:
        """Lengths of the paths (frames, fibres) [mm]."""
        return self._of(self._result.lengths, "paths")

    @property
    def fibre_lengths(self) -> Floats:
        """Lengths of the fibres (frames, fibres) [mm]."""
        return self._of(self._result.fibre_lengths, "fibres")

    @property
    def moment_arms(self) -> Mapping[str, JointArms]:
        """Moment arms by coordinate."""
        return self._result.moment_arms()[self.name]

    @property
    def architecture(self) -> Mapping[str, Any]:
        """Architecture at rest, by the names of ``report["definitions"]``."""
        return self._of({self.name: self._result.report["muscles"][self.name].get("architecture")}, "fibres")

    def surface(self, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return its surface in a kept frame, as ``result.muscle(name, frame=...)``."""
        return self._result.muscle(self.name, frame=frame, time=time)

    def fibres(self, *, frame: int | None = None, time: float | None = None) -> Any:
        """Return its fibres in a kept frame, as ``result.fibres(name, frame=...)``."""
        return self._result.fibres(self.name, frame=frame, time=time)

    def plot(self, **options: Any) -> Any:
        """Show the muscle with the bones, with the options of :meth:`Result.plot`."""
        return self._result.plot(muscles=self.name, **options)

    def _repr_html_(self) -> str:
        shown = {"frame": self._result.frames[-1], "show": False, "off_screen": True}
        return f"<p>{escape(repr(self))}</p>{html_picture(lambda: self.plot(**shown))}"

    def __repr__(self) -> str:
        words, lengths = "", self._result.fibre_lengths.get(self.name)
        if lengths is not None:
            mean = lengths.mean(axis=1)
            words = f"; {lengths.shape[1]} fibres, {mean.min():.1f} to {mean.max():.1f} mm"
        return f"MuscleResult({self.name!r}: {self.verdict}{words})"

    def _of(self, by_muscle: Mapping[str, One], what: str) -> One:
        if by_muscle.get(self.name) is None:
            raise InputError("", f"{self.name!r} has no {what}", "give it fibres")
        return by_muscle[self.name]
