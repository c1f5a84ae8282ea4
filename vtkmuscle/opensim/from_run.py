"""Muscles of a run in OpenSim and MuJoCo models."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import group_fibres
from vtkmuscle.core.motion.rigid import inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.io import write_text
from vtkmuscle.io.writing import Outputs, file_digest
from vtkmuscle.joints.tree import KinematicTree
from vtkmuscle.opensim.export_parts import (
    SPECIFIC_TENSION,
    ExportedMuscle,
    completed_properties,
    errors_table,
    opensim_properties,
    write_meshes,
)
from vtkmuscle.opensim.fitted_paths import fit_length, fit_points, rms
from vtkmuscle.opensim.mjcf import mjcf_of
from vtkmuscle.opensim.model import checked_model
from vtkmuscle.opensim.muscle_paths import MusclePath, moment_arm
from vtkmuscle.opensim.osim_text import MuscleOut, enriched, osim_of
from vtkmuscle.run.result import Result
from vtkmuscle.scene.data import MILLIMETRES, SceneError, SceneFiles, parsed
from vtkmuscle.scene.joints import SceneJoints, coordinate_values, joints_of, pin_joint_of
from vtkmuscle.scene.validation import validated
from vtkmuscle.scenes import Scene

#: Root mean square error of a point path in lengths and moment arms [m] above which a cylinder is added,
#: below the accuracy of meshes and landmarks.
TOLERANCE = 0.5e-3
_FORMS = ("functions", "points")
#: Class of a path without muscle properties in OpenSim.
GEOMETRY_ONLY = "PathActuator"


@dataclass(frozen=True)
class Export:
    """Options of an export.

    Attributes
    ----------
    form : str
        ``"functions"``: lengths as polynomials of the crossed coordinates (FunctionBasedPath).
        ``"points"``: points on bones and cylinders, the only form for MuJoCo.
    groups : int
        Largest number of fibre groups per muscle.
    parameters : mapping of str to mapping
        OpenSim properties by muscle. Missing properties come from the scene's ``hill``, from the replaced
        muscle, or from the architecture: fibre length and pennation at rest, with a slack tendon. Each
        group gets its fibres' share of ``max_isometric_force``.
    specific_tension : float
        Force per cross-section [N/cm^2], for forces from the architecture.
    kind : str
        Muscle class in OpenSim; ``"PathActuator"`` for paths without muscle properties.
    masses : mapping of str to float
        Masses of bodies in a new model [kg], by default 0.
    """

    form: str = "functions"
    groups: int = 1
    parameters: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    specific_tension: float = SPECIFIC_TENSION
    kind: str = "Millard2012EquilibriumMuscle"
    masses: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.form not in _FORMS:
            raise InputError("", f"there is no form {self.form!r}; allowed: {', '.join(_FORMS)}")


def write_opensim(
    source: str | PathLike[str],
    out: str | PathLike[str],
    *,
    result: Result | None = None,
    into: str | PathLike[str] | None = None,
    replace: Mapping[str, str] | None = None,
    **options: Any,
) -> list[ExportedMuscle]:
    """Write the muscles of a scene as an OpenSim model.

    Next to the model are ``NAME_errors.csv`` and, for a new model, meshes of bones and muscles in
    ``Geometry``.

    Parameters
    ----------
    source : path
        A scene.toml with ``[joints.NAME]`` or ``[opensim]``, which is run; or a folder of results.
    out : path
        The .osim file.
    result : Result, optional
        Result of the scene, instead of a new run.
    into : path, optional
        A model that gets the muscles and stays otherwise unchanged: the model of ``[opensim]``, or a
        model of the same bodies and coordinates. By default a new model with the scene's joints.
    replace : mapping of str to str, optional
        By muscle of the scene: the model's muscle whose name and properties are reused.
    **options
        Attributes of :class:`~vtkmuscle.opensim.Export`.

    Returns
    -------
    list of ExportedMuscle
        The muscles as written, and their errors.

    Raises
    ------
    SceneError, ValueError
        If the scene has no joints or is mirrored; if a muscle failed, has no fibres, crosses a constant
        coordinate or leaves no tendon; or if the model is not of version 4.
    """
    export, names, reused = Export(**options), dict(replace or {}), {}
    if into is not None:
        model = checked_model(Path(into))
        reused = {name: model.muscle(replaced).parameters for name, replaced in names.items()}
    elif names:
        raise InputError("replace", "there is no model to replace muscles in", "give the model as into")
    run = _run_of(Path(source), result)
    muscles = _exported(run, export, reused, names)
    outs = [muscle.out for muscle in muscles]
    if into is None:
        meshes = _meshes(run, Path(out))
        text = osim_of(run.ranged, outs, name=run.result.name, masses=export.masses, meshes=meshes)
    else:
        text = enriched(Path(into), outs, replace=list(names.values()))
    return _written(Path(out), text, muscles)


def write_mujoco(
    source: str | PathLike[str], out: str | PathLike[str], *, result: Result | None = None, **options: Any
) -> list[ExportedMuscle]:
    """Write the muscles of a scene as a MuJoCo model: tendons with actuators.

    Parameters
    ----------
    source, result : path, Result
        As in :func:`write_opensim`.
    out : path
        The .xml file (MJCF).
    **options
        Attributes of :class:`~vtkmuscle.opensim.Export` except ``form``. With the ``kind``
        ``"PathActuator"``, tendons have no actuators.

    Returns
    -------
    list of ExportedMuscle
        The muscles as written, with errors.

    Raises
    ------
    SceneError, ValueError
        As :func:`write_opensim`; and for joints that MuJoCo lacks, see :func:`~vtkmuscle.opensim.mjcf_of`.
    """
    export = Export(form="points", **options)
    run = _run_of(Path(source), result)
    muscles = _exported(run, export, {}, {})
    outs = [muscle.out for muscle in muscles]
    lengths = {muscle.name: muscle.path.lengths(run.tree, run.values) for muscle in outs}
    name, masses, meshes = run.result.name, export.masses, _meshes(run, Path(out))
    text = mjcf_of(run.ranged, outs, name=name, masses=masses, meshes=meshes, lengths=lengths)
    return _written(Path(out), text, muscles)


def export(
    source: str | PathLike[str],
    out: str | PathLike[str],
    *,
    into: str | PathLike[str] | None = None,
    replace: Mapping[str, str] | None = None,
    overwrite: bool = False,
    **options: Any,
) -> list[ExportedMuscle]:
    """Write the muscles of a scene with joints to OpenSim or MuJoCo.

    Parameters
    ----------
    source : path
        Folder of a run's results, or a scene.toml, which is run first.
    out : path
        An .osim file, as of :func:`write_opensim`, or an .xml file, as of :func:`write_mujoco`.
    into, replace : path, mapping of str to str, optional
        For OpenSim: a model to put the muscles into, and names there by muscle.
    overwrite : bool, optional
        Whether files from elsewhere are replaced; inputs never are.
    **options
        Attributes of :class:`Export`.

    Returns
    -------
    list of ExportedMuscle
        The muscles as written, with errors, which are also in OUT_errors.csv.

    Raises
    ------
    OSError, ValueError
        For another ending of the file, and as of the writers.
    """
    path, model = Path(out), None if into is None else Path(into)
    is_osim = path.suffix.lower() == ".osim"
    if not is_osim and path.suffix.lower() != ".xml":
        raise InputError(path, "unknown format of an export", "end its name in .osim or .xml")
    if not is_osim and (into is not None or replace):
        raise InputError("into", "muscles are put into models of OpenSim only", "leave it out")
    with Outputs.for_file(path, [Path(source), model], overwrite=overwrite):
        if is_osim:
            return write_opensim(source, path, into=model, replace=replace, **options)
        return write_mujoco(source, path, **options)


def _meshes(run: _Run, out: Path) -> dict[str, list[str]]:
    """Write meshes of bones, and of muscles at rest."""
    surfaces = {name: (run.joints.bodies[name], surface) for name, surface in run.scene.bones.items()}
    muscles = run.scene.muscles.items()
    surfaces |= {f"{name}_at_rest": (run.ends[name][0], muscle.surface) for name, muscle in muscles}
    return write_meshes(out.parent, surfaces, run.tree, run.joints.frame, run.metres)


def _written(out: Path, text: str, muscles: list[ExportedMuscle]) -> list[ExportedMuscle]:
    write_text(out, text)
    errors_table(muscles).to_csv(out.with_name(f"{out.stem}_errors.csv"), digits=6)
    return muscles


class _Run(NamedTuple):
    """A run of a scene with joints.

    ``tree`` is in metres, ``values`` (f,) are its coordinates, ``metres`` is the scene's unit of length. By
    muscle, ``ends`` are the bodies of origin and insertion, ``crossed`` the crossed coordinates.
    """

    scene: Scene
    result: Result
    joints: SceneJoints
    tree: KinematicTree
    values: dict[str, Floats]
    metres: float
    ends: dict[str, tuple[str, str]]
    crossed: dict[str, tuple[str, ...]]

    @property
    def ranged(self) -> KinematicTree:
        """The tree with the ranges of the run's poses, beyond which the paths are not fitted."""
        poses = {each: (float(column.min()), float(column.max())) for each, column in self.values.items()}
        moved = {name: span for name, span in poses.items() if name in self.tree.free and span[0] < span[1]}
        coordinates = [replace(q, range=moved.get(q.name, q.range)) for q in self.tree.coordinates]
        return replace(self.tree, coordinates=coordinates)


def _run_of(source: Path, result: Result | None) -> _Run:
    """Return a scene with its results, run if necessary."""
    path = source
    if source.is_dir():
        result = result or Result.load(source)
        path = Path(result.report["scene_file"])
        if not path.is_file() or file_digest(path) != result.report["sha256"]["scene"]:
            problem = f"the scene of these results, {path}, has changed or is missing"
            raise InputError(source, problem, "export the scene.toml")
    table = validated(parsed(path), path)
    files = SceneFiles(path)
    if table.mirror is not None:
        raise SceneError("mirrored scenes are not exported", "mirror", "export the other side", path)
    scene = Scene.load(path)
    metres = MILLIMETRES[scene.units] / 1000.0
    if (joints := joints_of(table, files)) is not None:
        _, values = coordinate_values(table, joints.tree, files)
    elif (pinned := pin_joint_of(scene.motion, scene.bones, MILLIMETRES[scene.units])) is not None:
        joints, values = pinned
    else:
        problem = "the scene has no joints, and its motion is no turn of one bone about a fixed axis"
        raise SceneError(problem, "joints", "add [joints.NAME] or [opensim]", path)
    tree, factors = joints.tree.in_metres(metres)
    ends, crossed = {}, {}
    for name, muscle in scene.muscles.items():
        bones = {area.role: area.bone for area in reversed(muscle.attachments)}
        ends[name] = (joints.bodies[bones["origin"]], joints.bodies[bones["insertion"]])
        on_way = tree.crossed(ends[name])
        crossed[name] = tuple(each for each in on_way if muscle.crosses is None or each in muscle.crosses)
        if still := [each for each in crossed[name] if each not in values or np.ptp(values[each]) < 1e-9]:
            grid = ", ".join(f"{each} = [FIRST, LAST, STEP]" for each in crossed[name])
            problem = f"the motion does not move {', '.join(still)}, crossed by muscle {name!r}"
            remedy = f"extend the motion, e.g. grid = {{ {grid} }}, or shorten muscles.{name}.crosses"
            raise SceneError(problem, "motion", remedy, path)
    result = result or scene.run(figures=False)
    now = {name: factors[name] * column[list(result.frames)] for name, column in values.items()}
    return _Run(scene, result, joints, tree, now, metres, ends, crossed)


def _exported(
    run: _Run, export: Export, reused: Mapping[str, Mapping[str, float]], names: Mapping[str, str]
) -> list[ExportedMuscle]:
    """Return the muscles of a run as paths, with the names and properties of replaced muscles."""
    result, muscles = run.result, run.scene.muscles
    if unknown := sorted({*reused, *export.parameters} - {*muscles}):
        problem = f"the scene has no muscle {unknown[0]!r}"
        raise InputError("", problem, f"its muscles are {', '.join(muscles)}")
    tree, values, exported = run.tree, run.values, []
    spans = {each: (column.min(), column.max()) for each, column in values.items()}
    rest = {each: np.clip([tree.coordinate(each).rest], *span) for each, span in spans.items()}
    for name, lengths in result.lengths.items():
        if len(lengths) < len(result.frames):
            raise InputError("", f"muscle {name!r} has {len(lengths)} of {len(result.frames)} frames")
        own = opensim_properties(muscles[name].hill, run.metres)
        fixed = {**reused.get(name, {}), **own, **export.parameters.get(name, {})}
        lines = _lines(run, name) if export.form == "points" else None
        groups, arms = group_fibres(lengths, export.groups), result.moment_arms()[name]
        units = {each: 1000.0 if tree.coordinate(each).is_angle else 1.0 for each in run.crossed[name]}
        for group in range(int(groups.max()) + 1):
            members = groups == group
            label = names.get(name, name) + ("" if groups.max() == 0 else f"_{group + 1}")
            changes = (lengths - lengths.mean(axis=0))[:, members].T
            mean = lengths[:, members].mean(axis=1) / 1000.0
            mean_arms = {at: arms[at].arms[:, members].mean(axis=1) / unit for at, unit in units.items()}
            if lines is None:
                path: MusclePath = fit_length(mean, {each: values[each] for each in mean_arms}, mean_arms)
            else:
                line, fitted = lines[:, members].mean(axis=1), (run.ends[name], mean, mean_arms)
                path = fit_points(line, tree, values, *fitted, tolerance=TOLERANCE)
            properties: dict[str, float] = {}
            if export.kind != GEOMETRY_ONLY:
                architecture = result.report["muscles"][name]["architecture"]
                at_rest, share = float(path.lengths(tree, rest)[0]), mean.mean() / lengths.mean() * 1000.0
                known = at_rest, float(share), export.specific_tension
                properties = completed_properties(fixed, architecture, name, *known)
                properties["max_isometric_force"] *= members.mean()
            errors = {q: (moment_arm(path, tree, values, q) - arm) * units[q] for q, arm in mean_arms.items()}
            off = rms(changes - changes.mean(axis=0)), 1000.0 * (path.lengths(tree, values) - mean), errors
            out, fibres = MuscleOut(label, path, properties, export.kind), np.flatnonzero(members).tolist()
            exported.append(ExportedMuscle(name, out, tuple(fibres), *off))
    return exported


def _lines(run: _Run, name: str) -> Floats:
    """Return the fibre paths (f, n, p, 3) in the root's frame [m]."""
    tree, joints = run.tree, run.joints
    rest, now = tree.poses({}), tree.poses(run.values)
    hold = rest[joints.fixed] @ inverses(now[joints.fixed])
    to_root = inverses(hold) @ rest[joints.frame]
    points = np.array([run.metres * run.result.paths(name, frame=each).points for each in run.result.frames])
    turns, shifts = to_root[:, None, :3, :3], to_root[:, None, None, :3, 3]
    return np.asarray(points @ turns.swapaxes(2, 3) + shifts)
