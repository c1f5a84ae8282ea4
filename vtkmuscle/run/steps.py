"""The steps of a run: check, solve, measure, write."""

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import fields, replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from vtkmodules.vtkCommonDataModel import vtkPolyData

from vtkmuscle.core.errors import InputError, check_name, fault_of
from vtkmuscle.core.mesh.shared import keep_shared
from vtkmuscle.io.csv_table import csv_rows
from vtkmuscle.io.surfaces import Series
from vtkmuscle.io.writing import Outputs
from vtkmuscle.plotting.views import DrawnBones
from vtkmuscle.run.figures import Drawing, figures_of_muscle, rest_pose_of
from vtkmuscle.run.frames import FrameChoice, MuscleTrack, Progress, RunOptions, frame_numbers
from vtkmuscle.run.muscles import MuscleRun, SceneRun
from vtkmuscle.run.pool import ENDED, Pool, pool_size, track_in
from vtkmuscle.run.report_values import DEFINITIONS, versions
from vtkmuscle.run.result import Result
from vtkmuscle.run.store import FORMAT, PAGE, ResultFolder, writing
from vtkmuscle.run.store.writing import DIGITS, ResultWriter
from vtkmuscle.run.table import MomentArmTable, Table, error_sizes
from vtkmuscle.run.verdict import Judged, further_reasons, missing_checks, with_reasons
from vtkmuscle.scene.data import SceneData, SceneError
from vtkmuscle.scene.sense import check_sense

#: Longest wait of the main thread [s]: on some systems Ctrl-C arrives only after it. A delay of 0.1 s seems
#: none (Miller 1968, doi:10.1145/1476589.1476628).
_LOOK_UP = 0.1

Tracks = dict[str, MuscleTrack]


@keep_shared()
def run_scene(scene: SceneData, out: Path | None, options: RunOptions) -> Result:
    """Run a scene: check, solve, measure, and write; see ``Scene.run``."""
    began = time.perf_counter()
    if out is not None:
        check_name(out)
    numbers = frame_numbers(options.frames, len(scene.motion.times))
    store = None if out is None else ResultWriter(out, scene, numbers)
    run, tracks = SceneRun(scene, numbers, store, options), Tracks()
    if store is not None and not options.fresh:
        tracks = store.finished(store.keys)
    if scene.muscle_contact != "off" and len(tracks) < len(scene.muscles):
        tracks = {}  # the other muscles ask these ones' filters
    with ExitStack() as stack:
        # Processes begin to solve while this one checks; they write once all is checked.
        pool, jobs = _started(run, tracks, stack)
        odd = check_sense(scene) if options.sense else []
        if store is not None and out is not None:
            stack.enter_context(writing.claimed(out, scene, overwrite=options.overwrite))
            stack.callback((pool or ExitStack()).close)  # no process writes when the folder is tidied
        own = {"taken_over": list(tracks), "sense": [str(error) for error in odd]}
        report = _first_report(run, tracks) | own
        result_of = partial(_result, run, report, bones := DrawnBones(scene.bones_data()))
        with _reported(store, report, tracks, result_of):
            drawing = None
            if store is not None:
                writing.remove_results(store.path, scene, list(tracks))
                store.write_report(report)
                drawing = Drawing(store.path / "figures", pool, bones) if options.figures else None
            (run if pool is None else pool).checked.set()

            def finish(name: str, track: MuscleTrack) -> None:
                result = result_of({name: track})
                _judge_further(scene, result, track, odd)
                if drawing is not None:
                    drawing.add(figures_of_muscle(result, name))

            _solve(run, tracks, report, pool, jobs, finish)
            result = result_of(tracks)
            if result.lengths and result.motion.coordinates:
                report["moment_arms"] = _refused(result)
            if store is not None:
                if drawing is not None:
                    drawing.add([rest_pose_of(result)])
                store.write_tables(result)
                if options.report:
                    before = time.perf_counter()
                    result.write_report(store.path / PAGE)
                    report["seconds"]["page"] = time.perf_counter() - before
                if drawing is not None:
                    report["figures"], report["seconds"]["figures"] = drawing.finish()
            report["complete"] = True
            report["seconds"]["total"] = time.perf_counter() - began
            if store is not None:
                store.complete(result, scene.bones)
    return result


#: The outputs that can be asked for alone.
ONLY = ("lengths", "moment_arms", "surfaces")


@keep_shared()
def run_only(
    scene: SceneData, what: str, out: str | PathLike[str] | None = None, *, frames: FrameChoice = None,
    workers: int | None = 1, overwrite: bool = False, progress: Progress | None = None,
) -> Table | dict[str, list[vtkPolyData]]:  # fmt: skip
    """Compute the lengths, the moment arms or the surfaces of a scene alone.

    ``what`` is ``"lengths"`` or ``"moment_arms"``, for a table with a row per muscle, path and frame [mm], or
    ``"surfaces"``, for the muscles in the frames. Tables take the paths alone: no muscle is deformed, no
    fibre is moved and no frame is measured. Surfaces take the deformer without fibres. With a folder ``out``,
    lengths.csv or moment_arms.csv with poses.csv, or a NAME.pvd per muscle is written; further options are
    those of :class:`~vtkmuscle.run.RunOptions`. Probable mistakes in the scene, and reasons of verdicts, are
    warnings. ValueError if the output is unknown, a file would be replaced, a stage cannot run, or the scene
    is implausible.

    Examples
    --------
    >>> from vtkmuscle import Scene, phantoms
    >>> from vtkmuscle.run import run_only
    >>> scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=8)
    >>> len(run_only(scene, "lengths", frames="0:2")["length_mm"])
    16
    """
    if what not in ONLY:
        raise InputError("", f"only is {what!r}, but must be one of {', '.join(map(repr, ONLY))}")
    names = [f"{name}.pvd" for name in scene.muscles]
    if what != "surfaces":
        scene, names = paths_alone(scene), [f"{what}.csv", *["poses.csv"] * bool(scene.motion.coordinates)]
    elif scene.deformer == "none":
        raise InputError("deformer", "it is 'none', so there are no surfaces", "use 'paths' or 'pbd'")
    outputs = None if out is None else Outputs(Path(out), inputs=scene.files, overwrite=overwrite)
    if outputs is not None and not overwrite and ResultFolder(outputs.folder).report() is not None:
        raise InputError(outputs.folder, "the folder has the results of a run", "give another --out")
    if outputs is not None:
        for file in map(outputs.folder.joinpath, names):
            outputs.check(file)
            rows = csv_rows(file) if file.name == f"{what}.csv" and file.is_file() and not overwrite else ()
            there = dict.fromkeys(cells[0] for _, cells in rows)
            writing.check_lost(file, [name for name in there if name not in ("muscle", *scene.muscles)])
    numbers = frame_numbers(frames, len(scene.motion.times))
    run = SceneRun(scene, numbers, None, RunOptions(workers=workers, progress=progress), what)
    report, tracks = _first_report(run, {}), Tracks()
    with ExitStack() as stack:
        started = _started(run, tracks, stack)
        check_sense(scene)
        _solve(run, tracks, report, *started)
    result = _result(run, report, DrawnBones(scene.bones_data()), tracks)
    if what != "surfaces":
        table = result.length_table() if what == "lengths" else result.moment_arms().table()
        if outputs is not None:
            with outputs:
                for name, each in zip(names, (table, result.pose_table()), strict=False):
                    each.to_csv(outputs.folder / name, digits=DIGITS if name == "moment_arms.csv" else None)
        return table
    surfaces = {name: list(track.surfaces) for name, track in tracks.items()}
    if outputs is not None:
        with outputs:
            for name, frames_of in surfaces.items():
                series = Series(outputs.folder, name)
                outputs.whole.add(series.path.with_suffix(""))
                for number, at, surface in zip(numbers, result.times, frames_of, strict=True):
                    series.add(number, at, surface)
    return surfaces


def paths_alone(scene: SceneData, **changes: Any) -> SceneData:
    """Return a scene whose muscles are paths without surfaces, with changed attributes."""
    fields_of = {field.name: getattr(scene, field.name) for field in fields(SceneData)}
    quality = None if scene.quality == "published" else scene.quality
    muscles = {name: replace(muscle, aponeuroses=()) for name, muscle in scene.muscles.items()}
    own = {"deformer": "none", "quality": quality, "muscle_contact": "off", "muscles": muscles}
    return SceneData(**fields_of | own | changes)


#: Muscles that processes solve, by their jobs.
Jobs = dict["Future[Any]", str]


def _started(run: SceneRun, tracks: Tracks, stack: ExitStack) -> tuple[Pool | None, Jobs]:
    """Return processes that have begun to solve the muscles without a track; none for a single process."""
    size = pool_size(run.scene, run.options.workers)
    if size == 1:
        return None, {}
    pool = stack.enter_context(Pool(size, run))
    left = [name for name in run.scene.muscles if name not in tracks]
    left.sort(key=lambda name: run.scene.muscles[name].surface.GetNumberOfCells(), reverse=True)
    return pool, {pool.solve(name): name for name in left}  # the largest first: none is left for the end


def _solve(
    run: SceneRun, tracks: Tracks, report: dict[str, Any], pool: Pool | None, jobs: Jobs,
    finish: Callable[[str, MuscleTrack], None] = lambda _name, _track: None,
) -> None:  # fmt: skip
    """Solve the muscles without a track, and add the tracks; ``finish`` is called for every muscle."""
    began = time.perf_counter()
    for name, track in tracks.items():
        run.report_progress(name, "done", 1.0)
        finish(name, track)
    names = [name for name in run.scene.muscles if name not in tracks]
    here = ThreadPoolExecutor(1, "muscles")  # VTK loses a Ctrl-C in the main thread
    neighbours: list[MuscleRun] = []

    def solve(name: str) -> MuscleTrack:
        """Solve a muscle in this process; later muscles may meet it."""
        muscle = MuscleRun(run, name, tuple(neighbours))
        muscle.go()
        neighbours.extend([muscle] * (run.scene.muscle_contact != "off"))
        return muscle.track

    try:
        if pool is None:
            jobs = {here.submit(solve, name): name for name in names}
        waiting: set[Future[Any]] = set(jobs)
        if run.store is not None:
            waiting.add(here.submit(run.store.write_bones, run.scene, run.stop))
        while waiting:
            done, waiting = wait(waiting, timeout=_LOOK_UP, return_when=FIRST_COMPLETED)
            if pool is not None:
                pool.pass_on(run.options)
            for job in done.difference(jobs):
                job.result()  # of the bones
            for job in sorted(done.intersection(jobs), key=lambda job: names.index(jobs[job])):
                track = tracks[name] = _outcome(job, name := jobs[job], run.scene)
                report["muscles"][name] = track.report
                finish(name, track)
    finally:
        run.stop.set()
        here.shutdown(cancel_futures=True)
    for name in run.scene.muscles:  # in the order of the scene
        tracks[name] = tracks.pop(name)
    report["seconds"] = {"muscles": time.perf_counter() - began}


def _outcome(job: Future[Any], name: str, scene: SceneData) -> MuscleTrack:
    """Return the result of a muscle's job. Faulty input raises a SceneError with the name of the muscle."""
    try:
        solved = job.result()
        return track_in(solved) if isinstance(solved, Path) else solved
    except BrokenProcessPool as error:
        raise ChildProcessError(ENDED) from error
    except SceneError:
        raise
    except (ValueError, TypeError) as error:
        problem, remedy = fault_of(error, placed=True)
        raise SceneError(problem, f"muscles.{name}", remedy, scene.files.get("")) from error


def _judge_further(scene: SceneData, result: Result, track: MuscleTrack, odd: Sequence[SceneError]) -> None:
    """Add errors, moment arms and further reasons to the report of a result's only muscle."""
    (name,) = result.muscle_names
    arms = MomentArmTable({})
    track.report["errors"] = error_sizes(track.errors())
    if result.lengths and result.motion.coordinates:
        with suppress(ValueError):  # the report of the run has the reason
            arms = result.moment_arms()
            if name in arms:
                track.report["moment_arms"] = arms.report(name, scene.muscles[name].muscle or name)
    muscle = Judged(name, scene, track, arms.get(name, {}))
    reasons, missing = further_reasons(muscle, odd), missing_checks(muscle)
    track.report["verdict"] = with_reasons(track.report["verdict"], reasons, missing)


def _refused(result: Result) -> dict[str, Any]:
    """Return the part of the report on coordinates without moment arms."""
    try:
        return {"refused": result.moment_arms().refused}
    except ValueError as error:
        return {"reason": str(error)}


def _result(run: SceneRun, report: dict[str, Any], drawn_bones: DrawnBones, tracks: Tracks) -> Result:
    scene, muscles = run.scene, run.scene.muscles.items()
    more: dict[str, Any] = {"literature": {name: muscle.literature for name, muscle in muscles}}
    more["crosses"] = {name: muscle.crosses for name, muscle in muscles if muscle.crosses is not None}
    return Result(scene.bones_data(), scene.motion, tracks, report, drawn_bones=drawn_bones, **more)


def _first_report(run: SceneRun, tracks: Tracks) -> dict[str, Any]:
    scene = run.scene
    return {
        "format": FORMAT,
        "scene": scene.name,
        "deformer": scene.deformer,
        "quality": scene.quality,
        "paths": None if scene.paths is None else dict(scene.paths),
        "scene_file": writing.scene_file(scene),
        "units": scene.units,
        "frame": scene.frame,
        "complete": False,
        "versions": versions(),
        "files": {key or "scene": str(path) for key, path in scene.files.items()},
        "sha256": writing.digests(scene),
        "frames": list(run.numbers),
        "times": [float(scene.motion.times[number]) for number in run.numbers],
        "definitions": dict(DEFINITIONS),
        "muscles": {name: tracks[name].report if name in tracks else {} for name in scene.muscles},
    }


@contextmanager
def _reported(
    store: ResultWriter | None, report: dict[str, Any], tracks: Tracks, result_of: Callable[[Tracks], Result]
) -> Iterator[None]:
    """Report the reason of a failed or stopped run. The tables of finished muscles are written too."""
    try:
        yield
    except BaseException as error:
        report["complete"] = False
        report["stopped_by"] = f"{type(error).__name__}: {error}".rstrip(": ")
        if store is not None:
            with suppress(OSError, InputError):  # the disk may have failed; the first error says more
                store.write_report(report)  # first: tables without a report would be a user's files
                if tracks:
                    store.write_tables(result_of(tracks))
        raise
