"""Muscles of a run in models of OpenSim and MuJoCo: paths with the run's lengths and moment arms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import group_errors, group_fibres
from vtkmuscle.core.motion.rigid import inverses
from vtkmuscle.core.types import Bools, Floats
from vtkmuscle.io import write_text
from vtkmuscle.io.parts import file_digest
from vtkmuscle.joints.tree import KinematicTree
from vtkmuscle.opensim.export_parts import (
    SPECIFIC_TENSION,
    completed_properties,
    opensim_properties,
    write_meshes,
)
from vtkmuscle.opensim.fitted_paths import fit_length, fit_points
from vtkmuscle.opensim.mjcf import mjcf_of
from vtkmuscle.opensim.model import checked_model
from vtkmuscle.opensim.muscle_paths import FunctionPath, PointPath, moment_arm
from vtkmuscle.opensim.osim_text import MuscleOut, enriched, osim_of
from vtkmuscle.run.result import Result
from vtkmuscle.run.table import Table
from vtkmuscle.scene.data import MILLIMETRES
from vtkmuscle.scene.faults import SceneError
from vtkmuscle.scene.files import SceneFiles, parsed
from vtkmuscle.scene.joints import SceneJoints, coordinate_values
from vtkmuscle.scene.motion import joints_of
from vtkmuscle.scene.validation import validated
from vtkmuscle.scenes import Scene

#: Error of a path over points in lengths and moment arms [m], root mean square, above which a cylinder is
#: added: less than that of meshes and landmarks.
TOLERANCE = 0.5e-3
_FORMS = ("functions", "points")
#: A path without a muscle in OpenSim.
GEOMETRY_ONLY = "PathActuator"


@dataclass(frozen=True, eq=False)
class ExportedMuscle:
    """A group of fibres as it was written, and its errors against the run.

    Attributes
    ----------
    muscle : str
        Of the scene.
    out : MuscleOut
        The muscle as written [m].
    fibres : tuple of int
        The group: the muscle stands for their mean.
    group_error : float
        RMS of the changes of their paths' lengths against the group's mean [mm].
    length_errors : (f,) array
        Of the path's length against the group's mean, in the poses of the run [mm].
    arm_errors : dict of str to (f,) array
        Of its moment arms against the group's mean, by coordinate [mm, 1 by a slide].
    """

    muscle: str
    out: MuscleOut
    fibres: tuple[int, ...]
    group_error: float
    length_errors: Floats
    arm_errors: dict[str, Floats]

    @property
    def errors(self) -> dict[str, Floats]:
        """Errors (f,) of the length and of the moment arms by coordinate."""
        return {"length": self.length_errors} | self.arm_errors

    def __str__(self) -> str:
        path = self.out.path
        if isinstance(path, FunctionPath):
            what = f"a polynomial of {', '.join(path.names)}, order {path.order}"
        else:
            what = f"{len(path.points)} points and {len(path.cylinders)} cylinders"
        listed = [
            f"{name} {_rms(off):.2g} (at most {np.abs(off).max():.2g})" for name, off in self.errors.items()
        ]
        return (
            f"{len(self.fibres)} fibres as {what}; errors in mm: {', '.join(listed)}; of the group "
            f"{self.group_error:.2g}"
        )


def errors_table(found: Sequence[ExportedMuscle]) -> Table:
    """Return the errors of paths in the poses of the run, a row per muscle and length or coordinate."""
    rows = (
        (one.out.name, name, _rms(off), float(np.abs(off).max()), float(off.mean()))
        for one in found
        for name, off in one.errors.items()
    )
    return Table(("muscle", "of", "rms_mm", "largest_mm", "mean_mm"), rows)


@dataclass(frozen=True)
class Export:
    """Options of an export.

    Attributes
    ----------
    form : str
        ``"functions"``, lengths as polynomials of the coordinates that a muscle crosses (FunctionBasedPath);
        or ``"points"``, points on bones and cylinders to wind round, which MuJoCo has alone.
    groups : int
        Groups of fibres per muscle, at most.
    parameters : mapping of str to mapping
        Properties of each muscle in OpenSim. The others are those of the scene's ``hill``, or of the muscle
        that it replaces, or follow from its architecture (fibres and pennation as measured at rest, where the
        tendon is slack). Each group has its fibres' share of ``max_isometric_force``.
    specific_tension : float
        Force per cross-section [N/cm^2], for the muscles whose force is that of their architecture.
    kind : str
        Class of the muscles in OpenSim; ``"PathActuator"`` for paths without muscles' properties.
    masses : mapping of str to float
        Of the bodies of a new model [kg]; the others have none.
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
    """Write the muscles of a scene with joints as a model of OpenSim.

    Beside it are ``NAME_errors.csv``, and for a new model the meshes of bones and muscles in ``Geometry``.

    Parameters
    ----------
    source : path
        A scene.toml with ``[joints.NAME]`` or ``[opensim]``, which is run; or the folder of its results.
    out : path
        The .osim file.
    result : Result, optional
        Of a run of the scene, in place of another one.
    into : path, optional
        A model that the muscles are put into, all else staying as it is: that of ``[opensim]``, or one of
        the same bodies and coordinates. By default none: a new model with the scene's joints.
    replace : mapping of str to str, optional
        By muscle of the scene, that of the model whose name and properties it takes.
    **options
        Of :class:`~vtkmuscle.opensim.Export`.

    Returns
    -------
    list of ExportedMuscle
        The muscles as written, and their errors.

    Raises
    ------
    SceneError, ValueError
        If the scene has no joints, is mirrored, or a muscle failed, has no fibres, crosses a coordinate that
        does not move or has no length left for a tendon; or if the model is not of version 4.
    """
    asked, names, theirs = Export(**options), dict(replace or {}), {}
    if into is not None:
        model = checked_model(Path(into))
        theirs = {name: model.muscle(one).parameters for name, one in names.items()}
    elif names:
        raise InputError("replace", "there is no model whose muscles are replaced", "give it as into")
    run = _run_of(Path(source), result)
    found = _exported(run, asked, theirs, names)
    outs = [one.out for one in found]
    if into is None:
        meshes = _meshes(run, Path(out))
        text = osim_of(run.tree, outs, name=run.result.name, masses=asked.masses, meshes=meshes)
    else:
        text = enriched(Path(into), outs, replace=list(names.values()))
    return _written(Path(out), text, found)


def write_mujoco(
    source: str | PathLike[str], out: str | PathLike[str], *, result: Result | None = None, **options: Any
) -> list[ExportedMuscle]:
    """Write the muscles of a scene with joints as a model of MuJoCo: tendons, and muscles that pull them.

    Parameters
    ----------
    source, result : path, Result
        As of :func:`write_opensim`.
    out : path
        The .xml file (MJCF).
    **options
        Of :class:`~vtkmuscle.opensim.Export` but ``form``. A ``kind`` of ``"PathActuator"`` leaves tendons
        without muscles.

    Returns
    -------
    list of ExportedMuscle
        The muscles as written, and their errors.

    Raises
    ------
    SceneError, ValueError
        As :func:`write_opensim`; and if MuJoCo has no such joints, see :func:`~vtkmuscle.opensim.mjcf_of`.
    """
    asked = Export(form="points", **options)
    run = _run_of(Path(source), result)
    found = _exported(run, asked, {}, {})
    text = mjcf_of(
        run.tree,
        [one.out for one in found],
        name=run.result.name,
        masses=asked.masses,
        meshes=_meshes(run, Path(out)),
        lengths={one.out.name: one.out.path.lengths(run.tree, run.values) for one in found},
    )
    return _written(Path(out), text, found)


def _meshes(run: _Run, out: Path) -> dict[str, list[str]]:
    """Write the meshes of bones, and of muscles at rest on the bodies of their origins."""
    surfaces = {name: (run.joints.bodies[name], surface) for name, surface in run.scene.bones.items()}
    muscles = run.scene.muscles.items()
    surfaces |= {f"{name}_at_rest": (run.ends[name][0], muscle.surface) for name, muscle in muscles}
    return write_meshes(out.parent, surfaces, run.tree, run.joints.frame, run.metres)


def _written(out: Path, text: str, found: list[ExportedMuscle]) -> list[ExportedMuscle]:
    write_text(out, text)
    errors_table(found).to_csv(out.with_name(f"{out.stem}_errors.csv"), digits=6)
    return found


class _Run(NamedTuple):
    """A run of a scene with joints.

    ``tree`` has its lengths and slides in metres, ``values`` (f,) are those of its coordinates, ``metres`` is
    the length of the unit of the scene. By muscle, ``ends`` are the bodies of origin and insertion, and
    ``crossed`` the coordinates that it crosses.
    """

    scene: Scene
    result: Result
    joints: SceneJoints
    tree: KinematicTree
    values: dict[str, Floats]
    metres: float
    ends: dict[str, tuple[str, str]]
    crossed: dict[str, tuple[str, ...]]


def _run_of(source: Path, result: Result | None) -> _Run:
    """Return a run of a scene: its results where they are there, else it is run."""
    path = source
    if source.is_dir():
        result = result or Result.load(source)
        path = Path(result.report["scene_file"])
        if not path.is_file() or file_digest(path) != result.report["sha256"]["scene"]:
            what = f"the scene that was run, {path}, has changed or is no longer there"
            raise InputError(source, what, "export its scene.toml, which runs it again")
    table = validated(parsed(path), path)
    files = SceneFiles(path)
    joints = joints_of(table, files)
    if joints is None:
        raise SceneError("the scene has no joints", "joints", "add [joints.NAME] or [opensim]", path)
    if table.mirror is not None:
        raise SceneError("mirrored scenes are not exported", "mirror", "export the other side", path)
    scene = Scene.load(path)
    metres = MILLIMETRES[scene.units] / 1000.0
    tree, factors = joints.tree.in_metres(metres)
    _, values = coordinate_values(table, joints.tree, files)
    ends, crossed = {}, {}
    for name, muscle in scene.muscles.items():
        bones = {area.role: area.bone for area in reversed(muscle.attachments)}
        ends[name] = (joints.bodies[bones["origin"]], joints.bodies[bones["insertion"]])
        crossed[name] = tuple(one for one in tree.crossed(ends[name]) if one in (muscle.crosses or ()))
        still = [one for one in crossed[name] if one not in values or np.ptp(values[one]) < 1e-9]
        if still:
            grid = ", ".join(f"{one} = [FIRST, LAST, STEP]" for one in crossed[name])
            raise SceneError(
                f"the motion does not move {', '.join(still)}, which muscle {name!r} crosses: the model "
                "would have no moment arms by that",
                "motion",
                f"move it too, e.g. grid = {{ {grid} }}, or leave it out of muscles.{name}.crosses",
                path,
            )
    result = result or scene.run(figures=False)
    now = {name: factors[name] * column[list(result.frames)] for name, column in values.items()}
    return _Run(scene, result, joints, tree, now, metres, ends, crossed)


def _exported(
    run: _Run, asked: Export, theirs: Mapping[str, Mapping[str, float]], names: Mapping[str, str]
) -> list[ExportedMuscle]:
    """Return the muscles of a run as paths.

    Muscles in ``names`` have the names of the muscles that they replace, whose properties are ``theirs``.
    """
    result, muscles = run.result, run.scene.muscles
    if unknown := sorted({*theirs, *asked.parameters} - {*muscles}):
        raise InputError("", f"the scene has no muscle {unknown[0]!r}", f"it has {', '.join(muscles)}")
    found: list[ExportedMuscle] = []
    for name, lengths in result.lengths.items():
        if len(lengths) < len(result.frames):
            raise InputError(
                "", f"muscle {name!r} failed after {len(lengths)} of {len(result.frames)} frames"
            )
        own = opensim_properties(muscles[name].hill, run.metres)
        given = {**theirs.get(name, {}), **own, **asked.parameters.get(name, {})}
        labels = group_fibres(lengths, asked.groups)
        lines = _lines(run, name) if asked.form == "points" else None
        for group in range(int(labels.max()) + 1):
            label = names.get(name, name) + ("" if labels.max() == 0 else f"_{group + 1}")
            found.append(_exported_group(run, asked, name, label, labels == group, lines, given))
    return found


def _exported_group(
    run: _Run,
    asked: Export,
    name: str,
    label: str,
    members: Bools,
    lines: Floats | None,
    given: Mapping[str, float],
) -> ExportedMuscle:
    """Return some fibres (n,) of a muscle as one muscle, over points where their lines are given."""
    tree, values, lengths = run.tree, run.values, run.result.lengths[name]
    count = int(members.sum())
    arms = run.result.moment_arms()[name]
    units = {one: 1000.0 if tree.coordinate(one).is_angle else 1.0 for one in run.crossed[name]}
    mean = lengths[:, members].mean(axis=1) / 1000.0
    by = {one: arms[one].arms[:, members].mean(axis=1) / unit for one, unit in units.items()}
    path: FunctionPath | PointPath
    if lines is None:
        path = fit_length(mean, {one: values[one] for one in by}, by)
    else:
        line = lines[:, members].mean(axis=1)
        path = fit_points(line, tree, values, run.ends[name], mean, by, tolerance=TOLERANCE)
    properties: dict[str, float] = {}
    if asked.kind != GEOMETRY_ONLY:
        rest = {
            one: np.clip([tree.coordinate(one).rest], column.min(), column.max())
            for one, column in values.items()
        }
        properties = completed_properties(
            given,
            run.result.report["muscles"][name]["architecture"],
            name,
            length=float(path.lengths(tree, rest)[0]),
            share=float(mean.mean() / lengths.mean() * 1000.0),
            specific_tension=asked.specific_tension,
        )
        properties["max_isometric_force"] *= count / len(members)
    return ExportedMuscle(
        name,
        MuscleOut(label, path, properties, asked.kind),
        tuple(int(i) for i in np.flatnonzero(members)),
        _rms(group_errors(lengths[:, members], np.zeros(count, dtype=np.int64))),
        1000.0 * (path.lengths(tree, values) - mean),
        {one: (moment_arm(path, tree, values, one) - arm) * units[one] for one, arm in by.items()},
    )


def _lines(run: _Run, name: str) -> Floats:
    """Return the points of the paths (f, n, p, 3) in the frame of the tree's root [m]."""
    tree, joints = run.tree, run.joints
    rest, now = tree.poses({}), tree.poses(run.values)
    hold = rest[joints.fixed] @ inverses(now[joints.fixed])
    to_root = inverses(hold) @ rest[joints.frame]
    frames = []
    for position, frame in enumerate(run.result.frames):
        points = run.metres * run.result.paths(name, frame=frame).points
        frames.append(points @ to_root[position, :3, :3].T + to_root[position, :3, 3])
    return np.array(frames)


def _rms(values: Floats) -> float:
    return float(np.sqrt((values**2).mean()))
