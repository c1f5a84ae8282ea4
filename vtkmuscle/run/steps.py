"""The steps of a run: check, solve, measure, write."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from vtkmuscle.core.errors import InputError, check_name, fault_of
from vtkmuscle.core.mesh.shared import keep_shared
from vtkmuscle.data.drawn_bones import DrawnBones
from vtkmuscle.io.writing import file_digest
from vtkmuscle.run.figures import draw_run
from vtkmuscle.run.frames import MuscleTrack, RunOptions, frame_numbers
from vtkmuscle.run.muscles import MuscleRun, SceneRun
from vtkmuscle.run.plausible import Judged, further_reasons, missing_checks
from vtkmuscle.run.pool import ENDED, Pool, pool_size, track_in
from vtkmuscle.run.report_values import DEFINITIONS, versions
from vtkmuscle.run.result import Result
from vtkmuscle.run.store import FORMAT, PAGE
from vtkmuscle.run.store.writing import ResultWriter, claimed, remove_results, scene_file
from vtkmuscle.run.table import error_sizes
from vtkmuscle.run.verdict import with_reasons
from vtkmuscle.scene.data import Anatomy, SceneData
from vtkmuscle.scene.faults import SceneError
from vtkmuscle.scene.sense import check_sense

#: Longest wait of the main thread [s]: on some systems Ctrl-C arrives only after it.
_LOOK_UP = 0.1

Tracks = dict[str, MuscleTrack]


@keep_shared()
def run_scene(scene: SceneData, out: Path | None, options: RunOptions) -> Result:
    """Run a scene: check, solve, measure, and write; see ``Scene.run``."""
    began = time.perf_counter()
    if out is not None:
        check_name(out)
    numbers = frame_numbers(options.frames, len(scene.motion.times))
    anatomy = Anatomy.of(scene)
    odd = check_sense(scene, anatomy) if options.sense else []
    with ExitStack() as stack:
        store, tracks = None, Tracks()
        if out is not None:
            stack.enter_context(claimed(out, scene, overwrite=options.overwrite))
            store = ResultWriter(out, scene, numbers)
            tracks = {} if options.fresh else store.kept()
        if scene.muscle_contact != "off" and len(tracks) < len(scene.muscles):
            tracks = {}  # the other muscles ask these ones' filters
        size, pool = pool_size(scene, options.workers), None
        if size > 1:
            pool = stack.enter_context(Pool(size, scene, numbers, options.clock, store))
        run = SceneRun(scene, numbers, anatomy.solid_bones, store, options, threading.Event())
        report = _first_report(run, tracks) | {
            "taken_over": list(tracks),
            "sense": [str(error) for error in odd],
        }
        result_of = partial(_result, run, report, DrawnBones(scene.bones_data()))
        with _reported(store, report, tracks, result_of):
            if store is not None:
                remove_results(store.path, scene, list(tracks))
                store.write_report(report)
            _solve(run, tracks, report, pool)
            result = result_of(tracks)
            _measure(result, tracks, report)
            _judge_further(scene, result, tracks, odd)
            if store is not None:
                _write_tables(store, result)
                write_page = partial(_write_page, store, result, options, report)
                if options.figures:
                    drawn = draw_run(result, store.path / "figures", pool, write_page)
                    report["figures"], report["seconds"]["figures"] = drawn
                else:
                    write_page()
            report["complete"] = True
            report["seconds"]["total"] = time.perf_counter() - began
            if store is not None:
                store.complete(report, scene, tracks)
    return result


def _solve(run: SceneRun, tracks: Tracks, report: dict[str, Any], pool: Pool | None) -> None:
    """Solve the muscles without a track. The tracks and reports are added to ``tracks`` and ``report``."""
    began = time.perf_counter()
    for name in tracks:
        run.report_progress(name, "done", 1.0)
    names = [name for name in run.scene.muscles if name not in tracks]
    here = ThreadPoolExecutor(1, "muscles")  # VTK loses a Ctrl-C in the main thread
    jobs: dict[Future[Any], str]
    try:
        if pool is None:
            others: list[MuscleRun] = []
            jobs = {here.submit(_solve_here, run, name, others): name for name in names}
        else:
            jobs = {pool.solve(name): name for name in names}
        if run.store is not None:
            run.store.write_bones(run.scene)
        waiting = set(jobs)
        while waiting:
            done, waiting = wait(waiting, timeout=_LOOK_UP, return_when=FIRST_COMPLETED)
            if pool is not None:
                pool.pass_on(run.options)
            for job in sorted(done, key=lambda job: names.index(jobs[job])):
                found = _outcome(job, jobs[job], run.scene)
                track = tracks[jobs[job]] = track_in(found) if isinstance(found, Path) else found
                report["muscles"][jobs[job]] = track.report
    finally:
        run.stop.set()
        here.shutdown(cancel_futures=True)
    for name in run.scene.muscles:  # in the order of the scene
        tracks[name] = tracks.pop(name)
    report["seconds"] = {"muscles": time.perf_counter() - began}


def _solve_here(run: SceneRun, name: str, others: list[MuscleRun]) -> MuscleTrack:
    """Solve a muscle in this process, and add the muscle to ``others`` if later muscles may meet it."""
    muscle = MuscleRun(run, name, MuscleTrack(), tuple(others))
    muscle.go()
    if run.scene.muscle_contact != "off":
        others.append(muscle)
    return muscle.track


def _outcome(job: Future[Any], name: str, scene: SceneData) -> Any:
    """Return the result of a muscle's job. Faulty input raises a SceneError with the name of the muscle."""
    try:
        return job.result()
    except BrokenProcessPool as error:
        raise ChildProcessError(ENDED) from error
    except SceneError:
        raise
    except (ValueError, TypeError) as error:
        problem, remedy = fault_of(error, placed=True)
        raise SceneError(problem, f"muscles.{name}", remedy, scene.files.get("")) from error


def _measure(result: Result, tracks: Tracks, report: dict[str, Any]) -> None:
    """Report the errors of lengths and the moment arms. Without moment arms the reason is reported."""
    for track in tracks.values():
        track.report["errors"] = error_sizes(track.errors())
    if result.lengths and result.motion.coordinates:
        try:
            table = result.moment_arms()
        except ValueError as error:
            report["moment_arms"] = {"reason": str(error)}
        else:
            report["moment_arms"] = {"refused": table.refused}
            for name in table:
                tracks[name].report["moment_arms"] = table.report(name)


def _judge_further(scene: SceneData, result: Result, tracks: Tracks, odd: Sequence[SceneError]) -> None:
    """Add to the verdicts what the scene, the muscle's own numbers and published numbers say."""
    arms = result.moment_arms() if result.has_moment_arms else {}
    for name, track in tracks.items():
        muscle = Judged(name, scene, track, arms.get(name, {}), result.lengths.get(name))
        reasons, missing = further_reasons(muscle, odd), missing_checks(muscle)
        track.report["verdict"] = with_reasons(track.report["verdict"], reasons, missing)


def _write_tables(store: ResultWriter, result: Result) -> None:
    """Write the tables of a result and of fibre measures."""
    for name, table in result.tables().items():
        if name == "fibre_lengths" or len(table["muscle"]):
            store.write_table(name, table)
    for name, table in result.fibre_tables():
        store.write_table(f"{name}_fibres", table)


def _write_page(store: ResultWriter, result: Result, options: RunOptions, report: dict[str, Any]) -> None:
    if options.report:
        before = time.perf_counter()
        result.write_report(store.path / PAGE)
        report["seconds"]["page"] = time.perf_counter() - before


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
        "format": FORMAT,
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
                    _write_tables(store, result_of(tracks))
        raise
