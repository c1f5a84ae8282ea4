"""Run a scene: every muscle over the motion, its fibres with it, all of it measured and written."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from vtkmuscle.core.bones.bone import Bone, bone_of
from vtkmuscle.core.errors import fault_of
from vtkmuscle.core.mesh.shared import held
from vtkmuscle.core.processors import processors
from vtkmuscle.data.arrays import checked_surface
from vtkmuscle.data.drawn_bones import DrawnBones
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.io.parts import file_digest
from vtkmuscle.run.claim import PAGE, claimed, scene_file
from vtkmuscle.run.drawing import Drawing
from vtkmuscle.run.folder import RunFolder
from vtkmuscle.run.memory import check_memory
from vtkmuscle.run.moment_arms import MomentArmTable
from vtkmuscle.run.muscles import MuscleRun
from vtkmuscle.run.options import ErrorStudy, Progress, RunOptions, frame_numbers
from vtkmuscle.run.report import DEFINITIONS, versions
from vtkmuscle.run.result import Result
from vtkmuscle.run.store.keys import muscle_keys
from vtkmuscle.run.track import MuscleTrack
from vtkmuscle.scene.data import SceneData
from vtkmuscle.scene.faults import SceneError
from vtkmuscle.scene.sense import check_sense

#: How often the main thread looks up from waiting [s]: on some systems Ctrl-C arrives only then.
_LOOK_UP = 0.2


@held()
def run_scene(
    scene: SceneData, out: Path | None, options: RunOptions, *, errors: ErrorStudy | None = None
) -> Result:
    """Run a scene; see :meth:`vtkmuscle.Scene.run`.

    Parameters
    ----------
    scene : SceneData
        Checked.
    out : Path or None
        Folder to write to.
    options : RunOptions
        What is asked for.
    errors : ErrorStudy, optional
        Further solves beside the run's own, and estimates of the errors.
    """
    with ExitStack() as stack:
        drawing = None
        if out is not None and options.figures:
            drawing = stack.enter_context(Drawing(out, scene))
        odd = check_sense(scene) if options.sense else []
        numbers = frame_numbers(options.frames, len(scene.motion.times))
        check_memory(scene, numbers)
        folder = None
        if out is not None:
            stack.enter_context(claimed(out, scene, overwrite=options.overwrite))
            folder = RunFolder(out, series=options.series)
        return _run(scene, numbers, options, folder, drawing, errors, odd)


def _run(
    scene: SceneData,
    numbers: range,
    options: RunOptions,
    folder: RunFolder | None,
    drawing: Drawing | None,
    errors: ErrorStudy | None,
    odd: list[str],
) -> Result:
    """Run a scene that is checked, into a folder that is held."""
    began = time.perf_counter()
    shapes = bone_shapes(scene)
    keys, kept = _kept(folder, scene, numbers, fresh=options.fresh)
    tracks = {name: kept.get(name) or MuscleTrack() for name in scene.muscles}
    report = _first_report(scene, numbers, tracks) | {"taken_over": list(kept), "sense": odd}
    stop, report_progress = threading.Event(), _one_at_a_time(options.progress)
    seen = options.observe or (lambda *_: None)
    further = {} if errors is None else errors.jobs(numbers, stop)

    def muscle_run(name: str, others: tuple[MuscleRun, ...]) -> MuscleRun:
        return MuscleRun(
            scene, name, tracks[name], shapes, folder, stop, report_progress, seen, others, options.clock
        )

    result_of = partial(_result, scene, numbers, report, DrawnBones(scene.bones_data()))
    draw = partial(_draw, drawing, tracks, result_of)
    try:
        jobs: dict[str, Future[None]] = {}
        count = _side_by_side(options.workers, scene, len(further))
        with ThreadPoolExecutor(count) as pool, _setting_if_interrupted(stop):
            if folder is not None:
                folder.begin(report, scene, keys, kept)
            for name in kept:
                report_progress(name, "done", 1.0)
            runs = _runs(scene, tracks, kept, muscle_run)
            jobs |= {f"muscles.{name}": pool.submit(run.go, numbers) for name, run in runs.items()}
            jobs |= {key: pool.submit(job) for key, job in further.items()}
            if folder is not None:
                folder.write_bones(scene, numbers, stop.is_set)
            _wait_for(jobs, stop, draw)
        _raise_first_failure(jobs, scene)
        result = result_of(tracks)
        report["seconds"] = {"muscles": time.perf_counter() - began}
        arms = _moment_arms(result, report)
        arms = _with_errors(arms, errors, result, tracks, report)
        if drawing is not None:
            drawing.others(result)
    except BaseException as error:
        report["stopped_by"] = f"{type(error).__name__}: {error}".rstrip(": ")
        if folder is not None:
            with suppress(OSError):  # the disk may be what failed; the first error says more
                folder.write_tables(report, scene, numbers, tracks)
        raise
    report["complete"] = True
    if folder is not None:
        folder.write_moment_arms(arms, tracks)
        folder.write_tables(report, scene, numbers, tracks)
        with _unfinished_if_it_fails(folder, report):
            _show(folder, result, report, drawing, page=options.report)
    report["seconds"]["total"] = time.perf_counter() - began
    if folder is not None:
        folder.write_report(report)
    return result


def _runs(
    scene: SceneData,
    names: Iterable[str],
    kept: Mapping[str, MuscleTrack],
    make: Callable[[str, tuple[MuscleRun, ...]], MuscleRun],
) -> dict[str, MuscleRun]:
    """Return the runs of the muscles that are not kept from an earlier one; each may meet those before it."""
    runs: dict[str, MuscleRun] = {}
    for name in names:
        if name not in kept:
            runs[name] = make(name, tuple(runs.values()) if scene.muscle_contact != "off" else ())
    return runs


def _side_by_side(workers: int | None, scene: SceneData, n_further: int) -> int:
    """Return how many threads to use for the muscles, and for further solves."""
    if scene.muscle_contact != "off":
        return 1  # each muscle waits for those before it, and shares their filters
    return min(workers or processors(), len(scene.muscles) + n_further)


def _draw(
    drawing: Drawing | None,
    tracks: Mapping[str, MuscleTrack],
    result_of: Callable[[dict[str, MuscleTrack]], Result],
    done: Iterable[str],
) -> None:
    """Let what can be drawn be drawn, after some more jobs."""
    if drawing is not None:
        drawing.rest(tracks)
        for name in (key.removeprefix("muscles.") for key in done):
            if name in tracks:
                drawing.muscle(result_of({name: tracks[name]}), name)


def _result(
    scene: SceneData,
    numbers: range,
    report: dict[str, Any],
    drawn_bones: DrawnBones,
    tracks: dict[str, MuscleTrack],
) -> Result:
    return Result(
        scene.name,
        scene.units,
        scene.bones_data(),
        scene.motion,
        numbers,
        tracks,
        report,
        literature={name: muscle.literature for name, muscle in scene.muscles.items()},
        crosses={name: one.crosses for name, one in scene.muscles.items() if one.crosses is not None},
        drawn_bones=drawn_bones,
    )


def _kept(
    folder: RunFolder | None, scene: SceneData, numbers: range, *, fresh: bool
) -> tuple[dict[str, str], dict[str, MuscleTrack]]:
    """Return the keys of the muscles, and those that the folder has finished."""
    if folder is None:
        return {}, {}
    keys = muscle_keys(scene, numbers)
    kept = {} if fresh else folder.finished(keys, scene.millimetres)
    if scene.muscle_contact != "off" and len(kept) < len(scene.muscles):
        kept = {}  # the others are kept out of these, and ask their filters for it
    return keys, kept


def _moment_arms(result: Result, report: dict[str, Any]) -> MomentArmTable:
    """Return the moment arms, and report them; where there are none, why."""
    if not result.lengths or not result.motion.coordinates:
        return MomentArmTable({})
    try:
        arms = result.moment_arms()
    except ValueError as error:
        report["moment_arms"] = {"reason": str(error)}
        return MomentArmTable({})
    report["moment_arms"] = {"refused": arms.refused}
    for name in arms:
        report["muscles"][name]["moment_arms"] = arms.report(name)
    return arms


def _with_errors(
    arms: MomentArmTable,
    study: ErrorStudy | None,
    result: Result,
    tracks: dict[str, MuscleTrack],
    report: dict[str, Any],
) -> MomentArmTable:
    """Estimate the errors of all muscles, and return the moment arms with theirs."""
    if study is None:
        return arms
    before = time.perf_counter()
    motion = result.motion.part(result.frames)
    for name, track in tracks.items():
        track.errors = study.estimates(name, track, motion)
    report["seconds"]["errors"] = time.perf_counter() - before
    return MomentArmTable(arms, arms.refused, result.errors)


def bone_shapes(scene: SceneData) -> dict[str, Bone]:
    """Return the bones that have an inside, holes closed."""
    shapes = {name: bone_of(*checked_surface(bone, name)) for name, bone in scene.bones.items()}
    return {name: bone for name, bone in shapes.items() if bone.solids.trees}


def _first_report(scene: SceneData, numbers: range, tracks: dict[str, MuscleTrack]) -> dict[str, Any]:
    return {
        "scene": scene.name,
        "model": scene.model,
        "scene_file": scene_file(scene),
        "units": scene.units,
        "complete": False,
        "versions": versions(),
        "files": {key or "scene": str(path) for key, path in scene.files.items()},
        "sha256": {key or "scene": file_digest(path) for key, path in scene.files.items() if path.is_file()},
        "frames": list(numbers),
        "times": [float(scene.motion.times[number]) for number in numbers],
        "definitions": dict(DEFINITIONS),
        "muscles": {name: track.report for name, track in tracks.items()},
    }


def _one_at_a_time(progress: Progress | None) -> Progress:
    lock = threading.Lock()

    def report_progress(muscle: str, stage: str, fraction: float) -> None:
        if progress is not None:
            with lock:
                progress(muscle, stage, fraction)

    return report_progress


@contextmanager
def _unfinished_if_it_fails(folder: RunFolder, report: dict[str, Any]) -> Iterator[None]:
    """Say in the report that the run was stopped, where it is in what comes after the frames."""
    try:
        yield
    except BaseException as error:
        report["complete"] = False
        report["stopped_by"] = f"{type(error).__name__}: {error}".rstrip(": ")
        with suppress(OSError):  # the disk may be what failed; the first error says more
            folder.write_report(report)
        raise


@contextmanager
def _setting_if_interrupted(stop: threading.Event) -> Iterator[None]:
    """Tell the threads to stop where the main thread is interrupted (Ctrl-C) or fails."""
    try:
        yield
    except BaseException:
        stop.set()
        raise


def _wait_for(
    jobs: Mapping[str, Future[None]], stop: threading.Event, look: Callable[[Iterable[str]], None]
) -> None:
    """Wait until all jobs have ended, and look now and then at what has; where one fails, stop the others."""
    keys = {job: key for key, job in jobs.items()}
    waiting = set(keys)
    while waiting:
        done, waiting = wait(waiting, timeout=_LOOK_UP, return_when=FIRST_COMPLETED)
        if any(job.exception() is not None for job in done):
            stop.set()
        if not stop.is_set():
            look(sorted(keys[job] for job in done))


def _raise_first_failure(jobs: dict[str, Future[None]], scene: SceneData) -> None:
    """Raise what went wrong first in the order of the scene, not what was merely stopped by it."""
    failures = {key: job.exception() for key, job in jobs.items()}
    for key, error in failures.items():
        if error is None or isinstance(error, AbortedError):
            continue
        if isinstance(error, ValueError | TypeError) and not isinstance(error, SceneError):
            problem, remedy = fault_of(error, placed=True)
            raise SceneError(problem, key, remedy, scene.files.get("")) from error
        raise error


def _show(
    folder: RunFolder, result: Result, report: dict[str, Any], drawing: Drawing | None, *, page: bool
) -> None:
    """Write the page of a run, and wait for its figures."""
    if page:
        bones = None if drawing is None else drawing.bones()
        if bones is not None:
            result.drawn_bones.by_name = dict(bones)
        before = time.perf_counter()
        result.write_report(folder.path / PAGE)
        report["seconds"]["page"] = time.perf_counter() - before
    if drawing is not None:
        report["figures"] = drawing.finish()
        report["seconds"]["figures"] = drawing.seconds
