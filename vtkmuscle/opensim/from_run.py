"""Muscles of a run as paths of OpenSim: functions of coordinates, or points on bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.groups import group_errors, group_fibres
from vtkmuscle.core.motion.frames import inverses
from vtkmuscle.core.types import Floats
from vtkmuscle.io import write_text
from vtkmuscle.opensim.enriching import enriched
from vtkmuscle.opensim.fitted_lengths import fit_length
from vtkmuscle.opensim.fitted_points import fit_points
from vtkmuscle.opensim.hill import opensim_properties
from vtkmuscle.opensim.mjcf import mjcf_of
from vtkmuscle.opensim.muscle_paths import FunctionPath
from vtkmuscle.opensim.osim_text import MuscleOut, osim_of
from vtkmuscle.opensim.scene_joints import SceneJoints, coordinate_values
from vtkmuscle.opensim.slide_units import slides_in_metres
from vtkmuscle.opensim.tree import KinematicTree
from vtkmuscle.run.result import Result
from vtkmuscle.scene.data import MILLIMETRES
from vtkmuscle.scene.faults import SceneError
from vtkmuscle.scene.files import SceneFiles, parsed
from vtkmuscle.scene.motion import joints_of
from vtkmuscle.scene.validation import validated
from vtkmuscle.scenes import Scene

#: Error of a path over points that further points are not worth [m], root mean square.
TOLERANCE = 0.5e-3
_FORMS = ("functions", "points")


@dataclass(frozen=True, eq=False)
class ExportedMuscle:
    """A group of fibres as it was written, and what that cost.

    Attributes
    ----------
    muscle : str
        Of the scene.
    out : MuscleOut
        What was written [m].
    fibres : tuple of int
        Those that it stands for.
    group_error : float
        RMS of the changes of their paths' lengths against the group's mean [mm].
    fit_error, largest_fit_error : float
        Of the path against the mean (functions) or the path that stands for the group (points) [mm]; for
        points the change of length counts.
    held_back_error : float or None
        Of a function, at poses by which its order was chosen [mm].
    """

    muscle: str
    out: MuscleOut
    fibres: tuple[int, ...]
    group_error: float
    fit_error: float
    largest_fit_error: float
    held_back_error: float | None = None

    def __str__(self) -> str:
        path = self.out.path
        if isinstance(path, FunctionPath):
            what = f"a polynomial of {', '.join(path.names)}, order {path.order}"
        else:
            moving = sum(point.moves for point in path.points)
            what = f"{len(path.points)} points" + (f", {moving} of them moving" if moving else "")
        return (
            f"{len(self.fibres)} fibres as {what}; error {self.fit_error:.2g} mm "
            f"(at most {self.largest_fit_error:.2g}), of the group {self.group_error:.2g} mm"
        )


def write_opensim(
    scene_file: str | PathLike[str],
    out: str | PathLike[str],
    *,
    result: Result | None = None,
    into: str | PathLike[str] | None = None,
    form: str = "functions",
    groups: int = 1,
    parameters: Mapping[str, Mapping[str, float]] | None = None,
    kind: str = "Millard2012EquilibriumMuscle",
) -> list[ExportedMuscle]:
    """Write the muscles of a scene with joints as a model of OpenSim.

    Parameters
    ----------
    scene_file : path
        A scene.toml with ``[joints.NAME]`` or ``[opensim]``.
    out : path
        The .osim file.
    result : Result, optional
        Of a run of the scene; without it the scene is run.
    into : path, optional
        A model that the muscles are put into, all else staying as it is: that of ``[opensim]``, or one of
        the same bodies and coordinates. By default none: a new model with the scene's joints.
    form : str, optional
        ``"functions"``, lengths as polynomials of the coordinates that a muscle crosses (FunctionBasedPath);
        or ``"points"``, a few points on bones.
    groups : int, optional
        Groups of fibres per muscle, at most.
    parameters : mapping of str to mapping, optional
        Properties of each muscle in OpenSim, in place of those of the scene's ``hill``; of
        ``max_isometric_force`` each group has its fibres' share. Paths without a muscle (``PathActuator``)
        have none of the scene's.
    kind : str, optional
        Class of the muscles in OpenSim.

    Returns
    -------
    list of ExportedMuscle
        What was written and what it cost.

    Raises
    ------
    SceneError, ValueError
        If the scene has no joints, is mirrored, or a muscle failed or has no fibres.
    """
    run = _run_of(Path(scene_file), result)
    asked = parameters or {}
    if kind != "PathActuator":
        asked = {name: {**hill, **asked.get(name, {})} for name, hill in run.hill.items()}
    found = export_muscles(*run.muscles, form=form, groups=groups, parameters=asked, kind=kind)
    outs = [one.out for one in found]
    text = osim_of(run.tree, outs, name=run.name) if into is None else enriched(Path(into), outs)
    write_text(Path(out), text)
    return found


def write_mujoco(
    scene_file: str | PathLike[str],
    out: str | PathLike[str],
    *,
    result: Result | None = None,
    groups: int = 1,
) -> list[ExportedMuscle]:
    """Write the muscles of a scene with joints as a model of MuJoCo: tendons over points fixed to bones.

    Parameters
    ----------
    scene_file : path
        A scene.toml with ``[joints.NAME]`` or ``[opensim]``.
    out : path
        The .xml file (MJCF).
    result : Result, optional
        Of a run of the scene; without it the scene is run.
    groups : int, optional
        Groups of fibres per muscle, at most.

    Returns
    -------
    list of ExportedMuscle
        What was written and what it cost.

    Raises
    ------
    SceneError, ValueError
        As :func:`write_opensim`; and if the joints have what MuJoCo has not, see
        :func:`~vtkmuscle.opensim.mjcf_of`.
    """
    run = _run_of(Path(scene_file), result)
    found = export_muscles(*run.muscles, form="points", groups=groups, moving=False)
    write_text(Path(out), mjcf_of(run.tree, [one.out for one in found], name=run.name))
    return found


class _Run(NamedTuple):
    """A run of a scene with joints, as exports take it.

    Its name, its tree [m], properties of muscles in OpenSim, and what :func:`export_muscles` takes.
    """

    name: str
    tree: KinematicTree
    hill: dict[str, dict[str, float]]
    muscles: tuple[Result, SceneJoints, Mapping[str, Floats], Mapping[str, tuple[str, ...]]]


def _run_of(path: Path, result: Result | None) -> _Run:
    """Return a run of a scene; without a result it is run."""
    table = validated(parsed(path), path)
    files = SceneFiles(path)
    joints = joints_of(table, files)
    if joints is None:
        raise SceneError("the scene has no joints", "joints", "add [joints.NAME] or [opensim]", path)
    if table.mirror is not None:
        raise SceneError("mirrored scenes are not exported", "mirror", "export the other side", path)
    scene = Scene.load(path)
    result = result or scene.run(figures=False)
    _, values = coordinate_values(table, joints.tree, files)
    now = {name: column[list(result.frames)] for name, column in values.items()}
    attached = {
        name: tuple(
            next(joints.bodies[area.bone] for area in muscle.attachments if area.role == role)
            for role in ("origin", "insertion")
        )
        for name, muscle in scene.muscles.items()
        if name in result.lengths
    }
    tree, _ = slides_in_metres(joints.tree.scaled(MILLIMETRES[scene.units] / 1000.0))
    hill = {
        name: opensim_properties(muscle.hill, MILLIMETRES[scene.units] / 1000.0)
        for name, muscle in scene.muscles.items()
    }
    return _Run(scene.name, tree, hill, (result, joints, now, attached))


def export_muscles(
    result: Result,
    joints: SceneJoints,
    values: Mapping[str, Floats],
    attached: Mapping[str, tuple[str, ...]],
    *,
    form: str = "functions",
    groups: int = 1,
    moving: bool = True,
    parameters: Mapping[str, Mapping[str, float]] | None = None,
    kind: str = "Millard2012EquilibriumMuscle",
) -> list[ExportedMuscle]:
    """Return the muscles of a run as paths.

    Parameters
    ----------
    result : Result
        Of a scene with joints.
    joints : SceneJoints
        Of the scene.
    values : mapping of str to (f,) array
        Of the joints' coordinates in the frames of the result [radians, or the scene's unit].
    attached : mapping of str to (str, str)
        The bodies of each muscle's origin and insertion.
    form, groups, parameters, kind
        As of :func:`write_opensim`.
    moving : bool, optional
        Whether points of a path may move on their bones.

    Raises
    ------
    ValueError
        If there is no such form, or a muscle failed.
    """
    if form not in _FORMS:
        raise InputError("", f"there is no form {form!r}; allowed: {', '.join(_FORMS)}")
    metres = MILLIMETRES[result.units] / 1000.0
    tree, factors = slides_in_metres(joints.tree.scaled(metres))
    in_metres = {one: factors[one] * column for one, column in values.items()}
    found: list[ExportedMuscle] = []
    for name, given in result.lengths.items():
        if len(given) < len(result.frames):
            raise InputError("", f"muscle {name!r} failed after {len(given)} of {len(result.frames)} frames")
        lengths = given / 1000.0
        labels = group_fibres(lengths, groups)
        errors, medoids = group_errors(lengths, labels)
        ends = attached[name]
        crossed = {one: in_metres[one] for one in tree.crossed(ends) if one in values}
        lines = _lines(result, name, joints, values, metres) if form == "points" else None
        own = dict((parameters or {}).get(name, {}))
        force = own.get("max_isometric_force")
        for group, medoid in enumerate(medoids):
            mine = np.flatnonzero(labels == group)
            label = name if len(medoids) == 1 else f"{name}_{group + 1}"
            if force is not None:
                own["max_isometric_force"] = force * len(mine) / len(labels)
            cost = 1000.0 * float(np.sqrt((errors[mine] ** 2).mean()))
            held_back = None
            if lines is None:
                fit = fit_length(lengths[:, mine].mean(axis=1), crossed)
                out = MuscleOut(label, fit.path, dict(own), kind)
                errs = (1000.0 * fit.error, 1000.0 * fit.largest_error)
                held_back = 1000.0 * fit.held_back_error
            else:
                points = fit_points(
                    lines[:, medoid],
                    tree,
                    in_metres,
                    (ends[0], ends[1]),
                    tolerance=TOLERANCE,
                    moving=moving,
                )
                out = MuscleOut(label, points.path, dict(own), kind)
                errs = (1000.0 * points.error, 1000.0 * points.largest_error)
            found.append(ExportedMuscle(name, out, tuple(int(i) for i in mine), cost, *errs, held_back))
    return found


def _lines(
    result: Result, name: str, joints: SceneJoints, values: Mapping[str, Floats], metres: float
) -> Floats:
    """Return the points of the paths (f, n, p, 3) in the frame of the tree's root [m]."""
    tree: KinematicTree = joints.tree
    rest, now = tree.poses({}), tree.poses(values)
    hold = rest[joints.fixed] @ inverses(now[joints.fixed])
    to_root = inverses(hold) @ rest[joints.frame]
    frames = []
    for position, frame in enumerate(result.frames):
        points = result.paths(name, frame=frame).points
        frames.append(metres * (points @ to_root[position, :3, :3].T + to_root[position, :3, 3]))
    return np.array(frames)
