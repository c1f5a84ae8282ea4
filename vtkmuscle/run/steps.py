"""The steps of a run: a scene is checked, its muscles are solved and measured, and the results written."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from vtkmuscle.core.errors import InputError, check_name, fault_of
from vtkmuscle.core.mesh.shared import held
from vtkmuscle.data.drawn_bones import DrawnBones
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.io.parts import file_digest
from vtkmuscle.run.cost import check_duration, check_memory
from vtkmuscle.run.figures import Drawing
from vtkmuscle.run.frames import MuscleTrack
from vtkmuscle.run.muscles import MuscleRun, SceneRun
from vtkmuscle.run.options import RunOptions, frame_numbers
from vtkmuscle.run.report_values import DEFINITIONS, versions
from vtkmuscle.run.result import Result
from vtkmuscle.run.store import PAGE
from vtkmuscle.run.store.writing import ResultWriter, claimed, scene_file
from vtkmuscle.run.workers import Workers
from vtkmuscle.scene.data import Anatomy, SceneData
from vtkmuscle.scene.faults import SceneError
from vtkmuscle.scene.sense import check_sense

#: Longest wait of the main thread [s]: on some systems Ctrl-C arrives only after it.
_LOOK_UP = 0.2

Tracks = dict[str, MuscleTrack]


@held()
def run_scene(scene: SceneData, out: Path | None, options: RunOptions) -> Result:
    """Run a scene: check it, solve and measure its muscles, and write the results; see ``Scene.run``."""
    began = time.perf_counter()
    with ExitStack() as stack:
        drawing = None
        if out is not None:
            check_name(out)
        # Processes are started first: they have much to load.
        if out is not None and options.figures:
            drawing = stack.enter_context(Drawing(out, scene))
        numbers = frame_numbers(options.frames, len(scene.motion.times))
        workers = stack.enter_context(Workers(scene, numbers, options, on_disk=out is not None))
        anatomy = Anatomy.of(scene)
        odd = check_sense(scene, anatomy) if options.sense else []
        check_memory(scene, numbers, on_disk=out is not None)
        check_duration(scene, numbers)
        store = None
        if out is not None:
            stack.enter_context(claimed(out, scene, overwrite=options.overwrite))
            store = ResultWriter(out, scene, numbers)
        kept = {} if store is None or options.fresh else store.kept()
        run = SceneRun(scene, numbers, anatomy.solid_bones, store, options, workers.stopped, workers.begun)
        tracks = {name: kept.get(name) or MuscleTrack() for name in scene.muscles}
        report = _first_report(run, tracks) | {"taken_over": list(kept), "sense": odd}
        result_of = partial(_result, run, report, DrawnBones(scene.bones_data()))
        with _reported(store, report, partial(result_of, tracks)):
            _solve(run, workers, tracks, list(kept), report, partial(_draw, drawing, tracks, result_of))
            result = result_of(tracks)
            _measure(result, tracks, report)
            if store is not None:
                _write_tables(store, result)
                _write(store, result, drawing, options, report)
            report["complete"] = True
            report["seconds"]["total"] = time.perf_counter() - began
            if store is not None:
                store.complete(report, tracks)
    return result


def _solve(
    run: SceneRun,
    workers: Workers,
    tracks: Tracks,
    kept: Iterable[str],
    report: dict[str, Any],
    draw: Callable[[Iterable[str]], None],
) -> None:
    """Solve the muscles that are not kept, side by side."""
    began = time.perf_counter()
    asked = [name for name in tracks if name not in kept]
    jobs: dict[str, Future[None]] = {}
    with workers:
        if run.store is not None:
            run.store.begin(report, list(kept))
        for name in kept:
            run.report_progress(name, "done", 1.0)
        muscles: list[MuscleRun] = []
        for name in workers.order(asked):
            met = () if run.scene.muscle_contact == "off" else tuple(muscles)
            muscles.append(MuscleRun(run, name, tracks[name], met))
            jobs[name] = workers.submit(muscles[-1])
        if run.store is not None:
            run.store.write_bones(run.stop.is_set)
        _wait_for(jobs, run.stop, draw)
    _raise_first_failure({name: jobs[name] for name in asked}, run.scene.files.get(""))
    report["seconds"] = {"muscles": time.perf_counter() - began}


def _measure(result: Result, tracks: Tracks, report: dict[str, Any]) -> None:
    """Report the errors of lengths, and the moment arms, or why there are none."""
    for track in tracks.values():
        track.report["errors"] = track.errors()
    if result.lengths and result.motion.coordinates:
        try:
            table = result.moment_arms()
        except ValueError as error:
            report["moment_arms"] = {"reason": str(error)}
        else:
            report["moment_arms"] = {"refused": table.refused}
            for name in table:
                tracks[name].report["moment_arms"] = table.report(name)


def _write_tables(store: ResultWriter, result: Result) -> None:
    """Write the tables of a result, and those of the measures of each muscle's fibres."""
    for name, table in result.tables().items():
        if name != "architecture" or len(table["muscle"]):
            store.write_table(name, table)
    for name, table in result.fibre_tables():
        store.write_table(f"{name}_fibres", table)


def _write(
    store: ResultWriter, result: Result, drawing: Drawing | None, options: RunOptions, report: dict[str, Any]
) -> None:
    """Write the page and the figures."""
    if drawing is not None:
        drawing.others(result)
    if options.report:
        bones = None if drawing is None else drawing.bones()
        if bones is not None:
            result.drawn_bones.by_name = dict(bones)
        before = time.perf_counter()
        result.write_report(store.path / PAGE)
        report["seconds"]["page"] = time.perf_counter() - before
    if drawing is not None:
        report["figures"] = drawing.finish()
        report["seconds"]["figures"] = drawing.seconds


def _draw(
    drawing: Drawing | None, tracks: Tracks, result_of: Callable[[Tracks], Result], done: Iterable[str]
) -> None:
    """Draw the figures of muscles that are done, and of the rest pose once it is known."""
    if drawing is not None:
        drawing.rest(tracks)
        for name in done:
            drawing.muscle(result_of({name: tracks[name]}), name)


def _result(run: SceneRun, report: dict[str, Any], drawn_bones: DrawnBones, tracks: Tracks) -> Result:
    scene = run.scene
    return Result(
        scene.bones_data(),
        scene.motion,
        tracks,
        report,
        literature={name: muscle.literature for name, muscle in scene.muscles.items()},
        crosses={name: one.crosses for name, one in scene.muscles.items() if one.crosses is not None},
        drawn_bones=drawn_bones,
    )


def _first_report(run: SceneRun, tracks: Tracks) -> dict[str, Any]:
    scene = run.scene
    return {
        "scene": scene.name,
        "deformer": scene.deformer,
        "scene_file": scene_file(scene),
        "units": scene.units,
        "complete": False,
        "versions": versions(),
        "files": {key or "scene": str(path) for key, path in scene.files.items()},
        "sha256": {key or "scene": file_digest(path) for key, path in scene.files.items() if path.is_file()},
        "frames": list(run.numbers),
        "times": [float(scene.motion.times[number]) for number in run.numbers],
        "definitions": dict(DEFINITIONS),
        "muscles": {name: track.report for name, track in tracks.items()},
    }


@contextmanager
def _reported(
    store: ResultWriter | None, report: dict[str, Any], result: Callable[[], Result]
) -> Iterator[None]:
    """Where a run fails or is stopped, write the finished frames' tables, and the reason in the report."""
    try:
        yield
    except BaseException as error:
        report["complete"] = False
        report["stopped_by"] = f"{type(error).__name__}: {error}".rstrip(": ")
        if store is not None:
            with suppress(OSError, InputError):  # the disk may have failed; the first error says more
                _write_tables(store, result())
                store.write_report(report)
        raise


def _wait_for(
    jobs: Mapping[str, Future[None]], stop: threading.Event, look: Callable[[Iterable[str]], None]
) -> None:
    """Wait until all jobs have ended, and give those that have to ``look``."""
    names = {job: name for name, job in jobs.items()}
    waiting = set(names)
    while waiting:
        done, waiting = wait(waiting, timeout=_LOOK_UP, return_when=FIRST_COMPLETED)
        if not stop.is_set():
            look(sorted(names[job] for job in done))


def _raise_first_failure(jobs: dict[str, Future[None]], file: Path | None) -> None:
    """Raise the first failure in the order of the scene; muscles that it stopped are no failures."""
    failures = {name: job.exception() for name, job in jobs.items()}
    for name, error in failures.items():
        if error is None or isinstance(error, AbortedError):
            continue
        if isinstance(error, ValueError | TypeError) and not isinstance(error, SceneError):
            problem, remedy = fault_of(error, placed=True)
            raise SceneError(problem, f"muscles.{name}", remedy, file) from error
        raise error
