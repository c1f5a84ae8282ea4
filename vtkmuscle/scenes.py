"""Scenes: read, check, save and run."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from html import escape
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.motion.rigid import RigidMotion
from vtkmuscle.core.words import ByName, listed, quoted, suggestion
from vtkmuscle.core.words import names as as_names
from vtkmuscle.data.arrays import blocks_of
from vtkmuscle.io.writing import Outputs
from vtkmuscle.pipelines import DEFORMER_SETTINGS
from vtkmuscle.plotting.drawing import html_picture
from vtkmuscle.run import Result, run_scene
from vtkmuscle.run.figures import plotter_at_rest
from vtkmuscle.run.frames import run_options
from vtkmuscle.scene.checks import checked
from vtkmuscle.scene.data import Muscle, SceneData, SceneError
from vtkmuscle.scene.reading import read_fields
from vtkmuscle.scene.schema import Fibres, Paths, Solver
from vtkmuscle.scene.writing import write_scene

if TYPE_CHECKING:
    from vtkmuscle.phantoms.phantom import Phantom

#: Fields of a scene that are no settings.
_CONTENT = ("name", "bones", "muscles", "motion", "joints", "files")
#: Fields of a scene that are settings.
_OWN = [each.name for each in fields(SceneData) if each.name not in _CONTENT]
#: Parameters of the paths among the settings: ``resolution`` alone is of the fibres.
_PATHS = {"n_paths": "n_paths"} | {f"paths.{name}": name for name in Paths.model_fields}
#: All settings of :meth:`Scene.with_settings`.
SETTINGS = list(dict.fromkeys([*_OWN, *_PATHS, *Solver.model_fields, *Fibres.model_fields]))
#: Settings of the deformer, and of the fibres: the first of equal names counts.
_SOLVER = Solver.model_fields.keys() - {*_OWN, *_PATHS}
_FIBRES = Fibres.model_fields.keys() - {*_OWN, *_PATHS, *_SOLVER}


@dataclass(frozen=True, eq=False)
class Scene(SceneData, ByName):
    """Bones, muscles and a motion, ready to run.

    A scene is checked. All lengths are in the scene's unit: coordinates, translations, and settings such as
    a tolerance. Reported quantities with a name in mm are in millimetres.

    Attributes
    ----------
    name : str
        Name of the scene.
    bones : mapping of str to vtkPolyData, or vtkMultiBlockDataSet
        Surfaces of triangles in the rest pose.
    muscles : mapping of str to Muscle
        Muscles to deform.
    motion : RigidMotion
        Motion of the bones; bones without a transform stay at rest.
    units : str
        ``"mm"``, ``"cm"`` or ``"m"``.
    solver : mapping
        Parameters of the deformer for all muscles.
    fixing : mapping
        Parameters of FixedPointDetector for all muscles.
    muscle_contact : str
        ``"off"``; ``"on"``, to keep each muscle out of preceding muscles; or ``"measure"``, to report the
        depth in preceding muscles.
    deformer : str
        ``"paths"``, skinning to taut paths (PathDeformer); ``"pbd"``, position based dynamics
        (PBDDeformer), without paths unless ``paths`` is given; or ``"none"``, the paths alone: lengths,
        moment arms and pictures of fibres, and no volume.
    paths : mapping or None
        Parameters of TautPaths for all muscles.
    quality : str or None
        A preset of numbers, ``"preview"``, ``"balanced"`` or ``"accurate"``, with deformer ``"pbd"`` also
        ``"published"``; the settings of ``paths``, ``solver`` and of the muscles override it.
    frame : str
        Frame of the surfaces, ``"LPS"`` or ``"RAS"``.
    guessed : mapping of str to float
        Confidence, 0 to 1, of guesses by the dotted keys of joints and units, until confirmed.
    joints : mapping of str to sequence of str
        Coordinates of the joints in the scene's file, to which guesses about a joint belong.
    files : mapping of str to Path
        Source file of the value of a dotted key; ``""`` is the scene's own file.

    Raises
    ------
    SceneError
        If the scene cannot be run; the message names file, key and remedy of each fault.

    Examples
    --------
    >>> import vtkmuscle
    >>> scene = vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.spindle_over_hinge())
    >>> result = scene.run(frames="0:2")
    >>> len(result.times)
    2
    """

    def __post_init__(self) -> None:
        bones = dict(blocks_of(self.bones)) if isinstance(self.bones, vtkMultiBlockDataSet) else self.bones
        object.__setattr__(self, "bones", _by_name("bones", bones, vtkPolyData))
        object.__setattr__(self, "muscles", _by_name("muscles", self.muscles, Muscle))
        motion: Any = self.motion
        if not isinstance(motion, RigidMotion):
            hint = "such as of vtkmuscle.hinge or vtkmuscle.io.read_motion_table"
            raise TypeError(f"Scene.motion is {quoted(motion)}, but must be a RigidMotion, {hint}")
        object.__setattr__(self, "muscles", checked(self))

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """Read a scene.toml, and check every key.

        The files of the scene are read too.

        Parameters
        ----------
        path : path
            The scene file; paths in the file are relative to the file's folder.

        Raises
        ------
        SceneError
            For all faults of the file; else for all unreadable files; else for all unusable surfaces and
            landmarks. Each fault has file, key, reason and remedy.
        """
        return cls(**read_fields(Path(path)))

    @classmethod
    def from_phantom(cls, phantom: "Phantom", *, n_fibres: int = 100, resolution: int = 15) -> Self:
        """Return a phantom's scene [mm].

        Every muscle has fibres. ``n_fibres`` counts fibres per muscle, ``resolution`` segments per fibre.
        """
        muscles = {}
        for name, surface in phantom.muscles.items():
            template = phantom.templates.get(name, "parallel")
            fibres = {"template": template, "n_fibres": n_fibres, "resolution": resolution}
            seen = phantom.superficial.get(name)
            muscles[name] = Muscle(surface, phantom.attachments[name], fibres, superficial_fibres=seen)
        return cls(phantom.name, phantom.bones, muscles, phantom.motion)

    def save(self, folder: str | PathLike[str]) -> Path:
        """Write the scene to a folder, as :meth:`load` reads it, and return the scene.toml.

        The folder is created if missing; files of equal names are replaced, but for the scene's own files,
        which may have comments: a ValueError. Joints of the scene's own file are kept, if the
        motion follows from them; those of an OpenSim model are not: the motion is then tables of transforms
        and coordinates, and moment arms of the saved scene are by coordinates that change alone.
        """
        if Path(folder).suffix == ".toml":
            raise SceneError("a scene is a folder with a scene.toml", "save", "give the folder", Path(folder))
        with Outputs(Path(folder), inputs=self.files, overwrite=True):
            return write_scene(self, Path(folder))

    def run(
        self,
        out: str | PathLike[str] | None = None,
        *,
        muscles: str | Sequence[str] | None = None,
        **options: Any,
    ) -> Result:
        """Deform and measure muscles over the motion.

        Fibres are moved with the muscles.

        Parameters
        ----------
        out : path, optional
            Folder to write to: a .pvd per muscle, per muscle's fibres and for the bones, lengths.csv,
            architecture.csv, moment_arms.csv, report.json, figures, and report.html. Finished muscles of an
            earlier run with equal inputs and settings are taken over; further files are left alone. The
            result reads frames from the folder. Without a folder frames stay in memory.
        muscles : str or sequence of str, optional
            Muscles to run; default all.
        **options
            Of :class:`vtkmuscle.run.RunOptions`: ``frames``, ``workers``, ``fresh``, ``overwrite``,
            ``figures``, ``report``, ``progress``, ``sense`` and ``clock``; and settings of
            :meth:`with_settings`, such as ``quality``, ``deformer`` or ``n_fibres``.

        Returns
        -------
        Result
            With ``report`` (a plain dict), ``verdicts``, ``lengths``, ``moment_arms()``, and the muscles,
            fibres and bones per frame. An incomplete muscle is ``"failed"`` and has the computed frames.

        Raises
        ------
        SceneError
            If a stage fails, or the scene is implausible; the message names muscle and remedy.
        TypeError
            For an unknown option.
        ValueError
            If frames do not exist, an option is not allowed, or files in the folder would be lost.
        OSError
            If the folder cannot be written to, or a concurrent run writes to the folder.
        KeyboardInterrupt
            On Ctrl-C; finished muscles are kept and listed in the report.
        """
        if out is not None and not str(out):
            raise ValueError("out is empty; give the name of a folder")
        scene, options = self.chosen(muscles, **options)
        return run_scene(scene, None if out is None else Path(out), run_options(options, SETTINGS))

    def chosen(
        self, muscles: str | Sequence[str] | None = None, **options: Any
    ) -> tuple[Self, dict[str, Any]]:
        """Return the scene with selected muscles and changed settings, and the remaining options."""
        scene = self if muscles is None else self.with_muscles(*as_names(muscles))
        settings = {name: options.pop(name) for name in SETTINGS if name in options}
        return scene.with_settings(**settings) if settings else scene, options

    def keys(self) -> list[str]:
        """Return the names of muscles and bones, over which a scene iterates."""
        return [*self.muscles, *self.bones]

    def __getitem__(self, name: str) -> Any:
        """Return a muscle or bone at rest. The data are PyVista's: ``scene["iliacus"].plot()``."""
        import pyvista  # noqa: PLC0415 -- a run needs none

        muscles = {muscle_name: muscle.surface for muscle_name, muscle in self.muscles.items()}
        surfaces: dict[str, Any] = {**self.bones, **muscles}
        if name not in surfaces:
            raise SceneError(f"the scene has no muscle or bone {name!r}", "", suggestion(name, surfaces))
        return pyvista.wrap(surfaces[name])

    def plot(
        self, *, muscles: str | Sequence[str] | None = None, show: bool = True, off_screen: bool | None = None
    ) -> Any:
        """Show bones, muscles and landmarks at rest, in a window or a cell of a notebook.

        Origins are black, insertions red, via rings white. ``muscles`` are shown, default all; SceneError for
        unknown names. With ``show=False`` the plotter is returned before it is shown; ``off_screen`` is
        PyVista's own setting by default.
        """
        shown = self if muscles is None else self.with_muscles(*as_names(muscles))
        plotter = plotter_at_rest(shown, off_screen)
        return plotter.show() if show else plotter

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self))}</p>" + html_picture(lambda: self.plot(show=False, off_screen=True))

    def __repr__(self) -> str:
        muscles, times = listed(list(self.muscles)), f"{(n := len(self.motion.times))} frame{'s' * (n != 1)}"
        return f"Scene({self.name!r}: {muscles}; bones {', '.join(self.bones)}; {times}; {self.units})"

    def with_muscles(self, *names: str | Sequence[str]) -> Self:
        """Return the scene with selected muscles, in order. Unknown names raise a SceneError."""
        asked = [name for several in names for name in as_names(several)]
        if not asked:
            raise SceneError("no muscle is named", "muscles", f"there are: {', '.join(self.muscles)}")
        for name in asked:
            if name not in self.muscles:
                remedy = suggestion(name, self.muscles)
                raise SceneError(f"the scene has no muscle {name!r}", "muscles", remedy, self.files.get(""))
        return replace(self, muscles={name: muscle for name, muscle in self.muscles.items() if name in asked})

    def with_settings(self, **settings: Any) -> Self:
        """Return the scene with changed settings.

        Parameters
        ----------
        **settings
            A field of the scene (``deformer``, ``quality``, ``paths``, ...), a parameter of the paths
            (``n_paths``, ``paths.resolution``) or of the deformer for all muscles (``iterations``), or a
            setting of the fibres of all muscles (``n_fibres``). Another ``deformer`` drops the settings of
            the scene that the deformer does not have.

        Raises
        ------
        SceneError
            If there is no such setting, or its value is not allowed.

        Examples
        --------
        >>> import vtkmuscle
        >>> scene = vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.spindle_over_hinge())
        >>> scene.with_settings(quality="preview", n_fibres=8).muscles["spindle"].fibres["n_fibres"]
        8
        """
        for name in sorted(settings.keys() - {*SETTINGS}):
            raise SceneError(f"a scene has no setting {name!r}", "", suggestion(name, SETTINGS))
        kept = DEFORMER_SETTINGS.get(str(settings.get("deformer", self.deformer)), {})
        own = {"solver": _part(self.solver, kept)} | _part(settings, _OWN)
        if paths := {_PATHS[name]: value for name, value in settings.items() if name in _PATHS}:
            own["paths"] = {**(own.get("paths", self.paths) or {}), **paths}
        solver, of_fibres = _part(settings, _SOLVER), _part(settings, _FIBRES)
        muscles = {}
        for name, muscle in self.muscles.items():
            fibres = None if muscle.fibres is None else {**muscle.fibres, **of_fibres}
            muscles[name] = replace(muscle, solver=_part(muscle.solver, kept) | solver, fibres=fibres)
        return replace(self, muscles=muscles, **own)


def _part(settings: Mapping[str, Any], names: Collection[str]) -> dict[str, Any]:
    """Return the settings with certain names."""
    return {name: value for name, value in settings.items() if name in names}


def _by_name(field: str, values: Any, kind: type) -> dict[str, Any]:
    """Return the values of a scene's field by name; TypeError for other kinds."""
    wrong = {field: values}
    if isinstance(values, Mapping):
        wrong = {f"{field}[{name!r}]": value for name, value in values.items() if not isinstance(value, kind)}
    for where, value in wrong.items():
        allowed = f"{field} must be a mapping of names to {kind.__name__}"
        raise TypeError(f"Scene.{where} is {' '.join(quoted(value).split())}, but {allowed}")
    return dict(values)
