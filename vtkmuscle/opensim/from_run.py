"""Muscles of a run in OpenSim and MuJoCo models."""

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from dataclasses import replace as with_changes
from itertools import product
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from vtkmodules.vtkFiltersCore import vtkQuadricDecimation
from vtkmodules.vtkIOGeometry import vtkSTLWriter

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.fibres.measures import group_fibres
from vtkmuscle.core.motion.coordinates import MILLIMETRES
from vtkmuscle.core.motion.rigid import apply_transform, inverses
from vtkmuscle.core.types import ROUNDING, Floats
from vtkmuscle.core.words import quoted
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.io import write_text
from vtkmuscle.io.writing import Outputs, file_digest, write_with
from vtkmuscle.joints.tree import KinematicTree
from vtkmuscle.opensim import export_parts as parts
from vtkmuscle.opensim.export_parts import PARTS, ExportedMuscle, fit_length, fit_points, rms
from vtkmuscle.opensim.mjcf import mjcf_of
from vtkmuscle.opensim.model import checked_model, own_name
from vtkmuscle.opensim.muscle_paths import FunctionPath, PointPath, moment_arm
from vtkmuscle.opensim.osim_text import MuscleOut, enriched, osim_of
from vtkmuscle.run.frames import RunOptions, run_options
from vtkmuscle.run.result import Result
from vtkmuscle.run.steps import paths_alone, run_scene
from vtkmuscle.run.table import Table
from vtkmuscle.run.verdict import FAILED
from vtkmuscle.scene.data import SceneError, SceneFiles, parsed, scene_errors_at
from vtkmuscle.scene.joints import SceneJoints, coordinate_values, joints_of, pin_joint_of
from vtkmuscle.scene.validation import validated
from vtkmuscle.scenes import Scene

#: Root mean square error of a point path in lengths and moment arms [m] above which a cylinder is added,
#: below the accuracy of meshes and landmarks.
TOLERANCE = 0.5e-3
#: Error of a path's moment arms in the poses of the run above which an export warns, as a part of the largest
#: arms of a coordinate (root mean squares). Fits to enough poses have 0.02 to 0.07.
LARGEST_ERROR = 0.1
_FORMS = ("functions", "points")
#: Class of a path without muscle properties in OpenSim.
GEOMETRY_ONLY = "PathActuator"
#: Triangles per mesh, at most; MuJoCo reads up to 200 000.
MOST_TRIANGLES = 100_000


@dataclass(frozen=True)
class Export:
    """Options of an export.

    Attributes
    ----------
    form : str
        ``"functions"``: lengths as polynomials of the crossed coordinates (FunctionBasedPath).
        ``"points"``: points on bones and cylinders, always for MuJoCo.
    groups : int
        Largest number of fibre groups per muscle.
    parameters : mapping of str to mapping
        OpenSim properties by muscle. Missing properties come from the scene's ``hill``, from the replaced
        muscle, or from the architecture: fibre length and pennation at rest, with a slack tendon. Each
        group gets its fibres' share of ``max_isometric_force``.
    specific_tension : float
        Force per cross-section [N/cm^2], for forces from the architecture.
    kind : str
        Muscle class in OpenSim; ``"PathActuator"`` for paths without muscle properties, and for tendons
        without actuators.
    masses : mapping of str to float
        Masses of bodies in a new model [kg], by default 0, and 0.001 for MuJoCo.
    """

    form: str = "functions"
    groups: int = 1
    parameters: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    specific_tension: float = parts.SPECIFIC_TENSION
    kind: str = "Millard2012EquilibriumMuscle"
    masses: Mapping[str, float] = field(default_factory=dict)


def export(
    source: Result | str | PathLike[str],
    out: str | PathLike[str],
    *,
    into: str | PathLike[str] | None = None,
    replace: Mapping[str, str] | None = None,
    overwrite: bool = False,
    **options: Any,
) -> list[ExportedMuscle]:
    """Write the muscles of a scene with joints to OpenSim or MuJoCo, and return them with errors.

    Muscles that failed in the run, or cross no coordinate, are left out, with a warning. A warning names
    muscles whose moment arms as written are wrong by a tenth. Where the motion does not move a coordinate
    that a muscle crosses, paths are computed in further poses. Next to the model are ``NAME_errors.csv`` and,
    for a new model, meshes of bones and muscles, ``Geometry/NAME_BONE.stl``; for MuJoCo the names begin
    with ``NAME_xml``. In MuJoCo muscles are tendons with actuators.

    Parameters
    ----------
    source : Result or path
        Result of a scene.toml, folder of a run's results, or a scene.toml, which is run first.
    out : path
        An .osim file, or an .xml file for MuJoCo (MJCF).
    into : path, optional
        A model of OpenSim that gets the muscles and stays otherwise unchanged: the model of ``[opensim]``, or
        a model of the same bodies and coordinates. By default a new model with the scene's joints.
    replace : mapping of str to str, optional
        By muscle of the scene: the model's muscle whose name and properties are reused.
    overwrite : bool, optional
        Whether files from elsewhere are replaced; inputs never are.
    **options
        Attributes of :class:`~vtkmuscle.opensim.Export`, and of :class:`~vtkmuscle.run.RunOptions` for a run,
        if one is needed; all frames are taken.

    Raises
    ------
    TypeError
        For another source, or an unknown option.
    OSError, SceneError, ValueError
        For another ending of the file; if the scene has no joints or is mirrored; if all muscles failed; if a
        muscle has no fibres, crosses a constant coordinate without a range where no coordinate of its unit
        moves, or has fibres longer than its path; if the model is not of version 4; or for joints that
        MuJoCo lacks, see :func:`~vtkmuscle.opensim.mjcf_of`.
    """
    if not isinstance(source, Result | str | PathLike):
        raise TypeError(f"an export takes a Result, its folder or a scene.toml, not {quoted(source)}")
    path, model, names = Path(out), None if into is None else Path(into), dict(replace or {})
    own = [each.name for each in fields(Export)]
    asked = Export(**{name: options.pop(name) for name in own if name in options})
    all_frames = run_options(options | {"frames": None}, own)
    is_osim, inputs = path.suffix.lower() == ".osim", [] if isinstance(source, Result) else [Path(source)]
    if not is_osim and path.suffix.lower() != ".xml":
        raise InputError(path, "unknown format of an export", "write .osim or .xml; the command also .usd")
    if not is_osim and (model is not None or names):
        raise InputError("into", "muscles are put into models of OpenSim only", "leave it out")
    if asked.form not in _FORMS:
        raise InputError("", f"there is no form {asked.form!r}; allowed: {', '.join(_FORMS)}")
    if not 0.0 < (tension := asked.specific_tension) < np.inf:
        raise InputError("specific_tension", f"{tension:g} N/cm^2 is not a finite number > 0", "e.g. 60")
    if names and model is None:
        raise InputError("replace", "there is no model to replace muscles in", "give the model as into")
    Outputs.for_file(path, [*inputs, model], overwrite=overwrite)  # before a run
    theirs = None if model is None else checked_model(model)
    reused = {} if theirs is None else {ours: theirs.muscle(name).parameters for ours, name in names.items()}
    run = _run_of(source, all_frames, {*reused, *asked.parameters})
    with Outputs.for_file(path, [*run.scene.files.values(), model], overwrite=overwrite):
        muscles: list[ExportedMuscle] = []
        for name in run.poses:
            hill = parts.opensim_properties(run.scene.muscles[name].hill, run.metres)
            fixed = {**reused.get(name, {}), **hill, **asked.parameters.get(name, {})}
            label, points = names.get(name, name), asked.form == "points" or not is_osim
            muscles += _exported(run, name, label, fixed, asked, points=points)
        outs, tree = [muscle.out for muscle in muscles], run.ranged
        name = re.sub(r"[^\w.-]", "_", run.result.name)  # OpenSim's names have no blanks
        if model is not None and theirs is not None:
            text = enriched(model, outs, replace=list(names.values()))
            for each in muscles:
                full = run.tree.completed(run.poses[each.muscle].values)
                known = {q.name: full[q.name] for q in theirs.tree.coordinates if q.name in full}
                ours, there = (each.out.path.lengths(bodies, known) for bodies in (run.tree, theirs.tree))
                if (off := float(np.abs(ours - there).max())) > TOLERANCE:
                    problem = f"{each.out.name!r} has lengths up to {1000 * off:.3g} mm off on these bodies"
                    raise InputError(model, problem, "give the model of [opensim], or form functions")
        elif is_osim:
            text = osim_of(tree, outs, name=name, masses=asked.masses, meshes=_write_meshes(run, path))
        else:
            meshes = _write_meshes(run, path)
            poses = {each.out.name: run.poses[each.muscle].values for each in muscles}
            lengths = {out.name: out.path.lengths(run.tree, poses[out.name]) for out in outs}
            text = mjcf_of(tree, outs, name=name, masses=asked.masses, meshes=meshes, lengths=lengths)
        write_text(path, text)
        errors = [(each.out.name, *item) for each in muscles for item in each.errors.items()]
        rows = [(*of, rms(off), float(np.abs(off).max()), float(off.mean())) for *of, off in errors]
        table = Table(("muscle", "of", "rms_mm", "largest_mm", "mean_mm"), rows)
        table.to_csv(path.with_name(f"{own_name(path)}_errors.csv"), digits=6)
        return muscles


class _Poses(NamedTuple):
    """Paths of a muscle by a result, with the coordinates' values (f,) in metres and radians."""

    result: Result
    values: dict[str, Floats]


class _Run(NamedTuple):
    """A run of a scene with joints.

    ``tree`` is in metres, ``metres`` is the scene's unit of length. By muscle, ``ends`` are the bodies of
    origin and insertion, ``crossed`` the crossed coordinates, and ``poses`` those of the result, or of a run
    of paths alone that moves further coordinates.
    """

    scene: Scene
    result: Result
    joints: SceneJoints
    tree: KinematicTree
    metres: float
    ends: dict[str, tuple[str, str]]
    crossed: dict[str, tuple[str, ...]]
    poses: dict[str, _Poses]

    @property
    def ranged(self) -> KinematicTree:
        """The tree with the ranges of the run's poses, beyond which the paths are not fitted."""
        own = []
        for q in self.tree.coordinates:
            columns = [poses.values[q.name] for poses in self.poses.values() if q.name in poses.values]
            every = np.concatenate(columns) if columns and q.name in self.tree.free else np.zeros(1)
            span = float(every.min()), float(every.max())
            own.append(with_changes(q, range=span if span[0] < span[1] else q.range))
        return with_changes(self.tree, coordinates=own)


def _scene_of(source: Result | str | PathLike[str]) -> tuple[Path, Result | None]:
    """Return a source's scene file, and results if any."""
    if not isinstance(source, Result):
        if not Path(source).is_dir():
            return Path(source), None
        source = Result.load(source)
    path = Path(source.report["scene_file"] or "scene.toml")  # none of a scene made in Python
    if not path.is_file() or file_digest(path) != source.report["sha256"].get("scene"):
        remedy = "export a scene.toml; Scene.save writes a scene made in Python"
        raise InputError(path, "the scene of these results has changed or is missing", remedy)
    return path, source


def _run_of(source: Result | str | PathLike[str], options: RunOptions, named: set[str]) -> _Run:
    """Return a scene with muscles ``named``, and its results, run if necessary."""
    path, result = _scene_of(source)
    table, files = validated(parsed(path), path), SceneFiles(path)
    if table.mirror is not None:
        raise SceneError("mirrored scenes are not exported", "mirror", "export the other side", path)
    scene = Scene.load(path)
    if result is not None:
        own, run = (np.array([*each.motion.transforms.values()]) for each in (scene, result))
        if own.shape != run.shape or not np.allclose(own, run):
            raise InputError(path, "the motion is not that of the results", "run the scene again")
    if unknown := sorted(named - {*scene.muscles}):
        remedy = f"its muscles are {', '.join(scene.muscles)}"
        raise InputError("", f"the scene has no muscle {unknown[0]!r}", remedy)
    metres = MILLIMETRES[scene.units] / 1000.0
    if (joints := joints_of(table, files)) is not None:
        _, values = coordinate_values(table, joints.tree, files)
    elif (pinned := pin_joint_of(scene)) is not None:
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
    frames = slice(None) if result is None else list(result.frames)
    values = {name: column[frames] for name, column in values.items()}
    moving = [name for name, column in values.items() if np.ptp(column) > ROUNDING]
    still = {name: tuple(each for each in on_way if each not in moving) for name, on_way in crossed.items()}
    with scene_errors_at("motion", path, "run more poses, or give the coordinate a range"):
        moved = {names: _with_moves(joints.tree, values, names) for names in dict.fromkeys(still.values())}
    result = result or run_scene(scene, None, options)
    as_run = scene.with_settings(**{name: result.report[name] for name in ("deformer", "quality", "paths")})
    failed = [name for name, verdict in result.verdicts.items() if verdict == FAILED or not crossed[name]]
    if not (whole := [name for name in result.lengths if name not in failed]):
        remedy = "a run has the reasons; give the muscles fibres, and for deformer 'pbd' paths too"
        raise InputError(path, "no muscle with paths crosses a coordinate and did not fail", remedy)
    if failed:
        warnings.warn(f"left out, for they failed or cross no coordinate: {', '.join(failed)}", stacklevel=4)
    poses: dict[str, _Poses] = {}
    for names, columns in moved.items():
        measured, muscles = result, [muscle for muscle in whole if still[muscle] == names]
        if names and muscles:
            motion = joints.motion_of(np.arange(float(len(columns[names[0]]))), columns)
            alone = paths_alone(as_run.with_muscles(*muscles), motion=motion)
            measured = run_scene(alone, None, with_changes(options, sense=False))
        now = {name: factors[name] * column for name, column in columns.items()}
        poses |= dict.fromkeys(muscles, _Poses(measured, now))
    return _Run(scene, result, joints, tree, metres, ends, crossed, {name: poses[name] for name in whole})


def _with_moves(tree: KinematicTree, values: Mapping[str, Floats], still: Sequence[str]) -> dict[str, Floats]:
    """Return a run's poses, and some of these with coordinates of ``still`` on either side of their values.

    A coordinate moves within its range, and no farther than the run moves another coordinate of the unit. Of
    a polynomial, lengths and slopes at three values determine five orders.
    """
    count = len(next(iter(values.values())))
    poses = {name: np.full(count, tree.coordinate(name).rest) for name in still} | dict(values)
    levels = []
    for name in still:
        own, here = tree.coordinate(name), poses[name][0]
        spans = [np.ptp(column) for each, column in values.items() if tree.coordinate(each).unit == own.unit]
        half = 0.5 * max(spans, default=0.0) or np.inf
        low, high = own.range or (-np.inf, np.inf)
        ends = max(low, here - half), min(high, here + half)
        if not np.isfinite(ends).all():
            raise InputError("", f"the run ({count} poses) does not move {name!r}, and it has no range")
        levels.append(sorted({here, *ends}))
    chosen = np.unique(np.linspace(0, count - 1, PARTS).round().astype(int))
    blocks: dict[str, list[Floats]] = {name: [] for name in poses}
    for at in product(*levels):
        moved = {name: np.full(count, value) for name, value in zip(still, at, strict=True)}
        rows = chosen if any(moved[name][0] != poses[name][0] for name in still) else slice(None)
        for name, column in (poses | moved).items():
            blocks[name].append(column[rows])
    return {name: np.concatenate(columns) for name, columns in blocks.items()}


def _exported(
    run: _Run, name: str, label: str, fixed: Mapping[str, float], options: Export, *, points: bool
) -> Iterator[ExportedMuscle]:
    """Yield the groups of a muscle as paths, called by a label, with ``fixed`` properties completed."""
    tree, (measured, values) = run.tree, run.poses[name]
    for each in (run.result, measured):
        if len(each.lengths[name]) < len(each.frames):
            computed = f"{len(each.lengths[name])} of {len(each.frames)} frames"
            raise InputError("", f"muscle {name!r} has {computed}")
    lengths, arms = measured.lengths[name], measured.moment_arms()[name]
    if missing := [coordinate for coordinate in run.crossed[name] if coordinate not in arms]:
        problem = f"muscle {name!r} crosses {missing[0]!r}, and has no moment arms by it"
        raise InputError("motion.coordinates", problem, "add the coordinate, or leave the key out")
    kept = np.arange(len(lengths))  # but for frames without moment arms: where paths do not come to rest
    for coordinate in run.crossed[name]:
        kept = np.intersect1d(kept, arms[coordinate].frames)
    values, lengths = {q: column[kept] for q, column in values.items()}, lengths[kept]
    if not len(lengths):
        raise InputError("", f"the paths of muscle {name!r} come to rest in no frame")
    lines = _lines(run, name)[kept] if points else None
    number_of = group_fibres(lengths, options.groups)
    units = {each: 1000.0 if tree.coordinate(each).is_angle else 1.0 for each in run.crossed[name]}
    of_paths = {q: arms[q].arms[np.isin(arms[q].frames, kept)] for q in units}
    for group in range(int(number_of.max()) + 1):
        members = number_of == group
        changes = (lengths - lengths.mean(axis=0))[:, members].T
        mean = lengths[:, members].mean(axis=1) / 1000.0
        mean_arms = {q: of_paths[q][:, members].mean(axis=1) / unit for q, unit in units.items()}
        if lines is None:
            columns = {each: values[each] for each in mean_arms}
            path: FunctionPath | PointPath = fit_length(mean, columns, mean_arms)
        else:
            line, fitted = lines[:, members].mean(axis=1), (run.ends[name], mean, mean_arms)
            path = fit_points(line, tree, values, *fitted, tolerance=TOLERANCE)
        properties: dict[str, float] = {}
        if options.kind != GEOMETRY_ONLY:
            architecture = run.result.report["muscles"][name]["architecture"]
            at_rest, share = measured.track(name).rest_lengths[members].mean(), mean.mean() / lengths.mean()
            of_path = float(at_rest) / 1000.0, float(share) * 1000.0, options.specific_tension
            properties = parts.completed_properties(fixed, architecture, name, *of_path)
            properties["max_isometric_force"] *= members.mean()
        errors = {"length": 1000.0 * (path.lengths(tree, values) - mean)}
        errors |= {q: (moment_arm(path, tree, values, q) - arm) * units[q] for q, arm in mean_arms.items()}
        own = label if number_of.max() == 0 else f"{label}_{group + 1}"
        off, worst = max((rms(errors[q]), q) for q in mean_arms)
        if off > LARGEST_ERROR * (largest := max(rms(arm) * units[q] for q, arm in mean_arms.items())):
            of = f"{off:.2g} mm about {worst}, with arms up to {largest:.2g} mm (root mean squares)"
            words = f"moment arms of {own!r} as written are wrong by {of} in the poses of the run; give the "
            warnings.warn(f"{words}motion more poses, or try another form or more groups", stacklevel=3)
        out = MuscleOut(own, path, properties, options.kind)
        spread = rms(changes - changes.mean(axis=0))
        yield ExportedMuscle(name, out, tuple(np.flatnonzero(members).tolist()), spread, errors)


def _lines(run: _Run, name: str) -> Floats:
    """Return the fibre paths (f, n, p, 3) in the root's frame [m]."""
    tree, joints, (measured, values) = run.tree, run.joints, run.poses[name]
    rest, now = tree.poses({}), tree.poses(values)
    to_root = inverses(rest[joints.fixed] @ inverses(now[joints.fixed])) @ rest[joints.frame]
    points = np.array([run.metres * measured.paths(name, frame=each).points for each in measured.frames])
    turns, shifts = to_root[:, None, :3, :3], to_root[:, None, None, :3, 3]
    return np.asarray(points @ turns.swapaxes(2, 3) + shifts)


def _write_meshes(run: _Run, model: Path) -> dict[str, list[str]]:
    """Write bones, and muscles at rest, in frames of bodies [m]. Return file names by body."""
    prefix = re.sub(r"[^\w.-]", lambda sign: f"~{ord(sign[0]):x}", own_name(model))
    surfaces = {name: (run.joints.bodies[name], surface) for name, surface in run.scene.bones.items()}
    muscles = run.scene.muscles.items()
    surfaces |= {f"{name}_at_rest": (run.ends[name][0], muscle.surface) for name, muscle in muscles}
    rest = run.tree.poses({})
    names: dict[str, list[str]] = {}
    for name, (body, surface) in surfaces.items():
        placed = (inverses(rest[body]) @ rest[run.joints.frame])[0]
        mesh, kept = surface, MOST_TRIANGLES / surface.GetNumberOfCells()
        if kept < 1.0:
            mesh = vtkQuadricDecimation(input_data=surface, target_reduction=1.0 - kept).update().output
        moved = with_points(mesh, apply_transform(placed, run.metres * points_of(mesh)))
        writer = vtkSTLWriter(input_data=moved, header="vtkmuscle, metres", file_type=2)  # binary
        write_with(writer, model.parent / parts.FOLDER / f"{prefix}_{name}.stl")
        names.setdefault(body, []).append(f"{prefix}_{name}")
    return names
