"""Many scenes in a table: cohorts and varied settings."""

import hashlib
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, as_completed
from contextlib import ExitStack, suppress
from dataclasses import replace
from itertools import product
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.machine import processors
from vtkmuscle.io.children import processes
from vtkmuscle.io.writing import Outputs, locked
from vtkmuscle.run import Result, Table, frame_numbers
from vtkmuscle.run.frames import run_options
from vtkmuscle.run.store import PAGE, ResultFolder, digest_of, muscle_keys
from vtkmuscle.run.store.writing import digests
from vtkmuscle.scenes import SETTINGS, Scene

#: Columns that every table has after the subject or the settings; columns of numbers follow.
COLUMNS = ("muscle", "verdict", "message", "folder")
#: A subject's name is cut to this number of characters in its folder's name: file systems hold 255 bytes.
_LONGEST = 40

Row = dict[str, Any]
#: Warnings of a child process, for the parent process.
Warned = list[tuple[str, type[Warning]]]
_warned: Warned = []


def cohort(
    scenes: Mapping[str, Scene | str | PathLike[str]] | Sequence[Scene | str | PathLike[str]],
    out: str | PathLike[str] | None = None, *, client: Any = None, workers: int | None = None,
    progress: Callable[[Sequence[Row]], None] | None = None, **options: Any,
) -> Table:  # fmt: skip
    """Run the scene of each subject into a table.

    The table has a row per muscle.

    Parameters
    ----------
    scenes : mapping of str to Scene or path, or sequence of Scene or path
        Scenes by the name of the subject; by default the path, or the name of the scene.
    out : path, optional
        Folder for the results: a run folder per subject, and ``cohort.csv``. A finished run folder with
        equal scene, settings, frames and package is read instead of run again, unless a page or figures are
        missing. Without a folder no files are kept.
    client : distributed.Client, optional
        Of a Dask cluster with folders shared by all workers; give ``out`` with ``client``. Default: processes
        of this machine.
    workers : int, optional
        Number of processes, by default one per processor; 1 runs the scenes in this process.
    progress : callable, optional
        Called with the rows of each finished subject.
    **options
        Of :meth:`vtkmuscle.Scene.run`: ``muscles``, ``frames``, ``fresh``, ``overwrite``, ``figures``,
        ``report``, and settings such as ``quality``, ``deformer`` or ``n_fibres``. Figures and pages are off
        by default.

    Returns
    -------
    Table
        In the order of the scenes. ``length``, ``fibre_length`` [mm] and ``moment_arm_COORDINATE`` [mm] are
        means over fibres and frames, with the least and largest mean of a frame; a number missing for a
        muscle is NaN. A scene with an error is a row with verdict ``"failed"``, no muscle,
        and the reason as message.

    Raises
    ------
    ValueError
        If there are no scenes, two subjects share a name, or an option is not allowed.
    TypeError
        For an unknown option.
    OSError
        If the folder cannot be written to, or is in use by a concurrent process.

    Examples
    --------
    >>> import vtkmuscle
    >>> scene = vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.spindle_over_hinge(), n_fibres=8)
    >>> table = vtkmuscle.cohort({"anna": scene, "ben": scene}, workers=1, frames="0:2")
    >>> table["subject"]
    array(['anna', 'ben'], dtype='<U4')
    """
    every = [scenes] if isinstance(scenes, Scene | str | PathLike) else scenes
    names = [scene.name if isinstance(scene, Scene) else str(scene) for scene in every]
    listed = scenes.values() if isinstance(scenes, Mapping) else every
    labelled = [({"subject": name}, scene) for name, scene in zip(names, listed, strict=True)]
    return run_labelled(labelled, out, client, workers, progress, options)


def vary(
    scene: Scene | str | PathLike[str], *, out: str | PathLike[str] | None = None, client: Any = None,
    workers: int | None = None, frames: str | slice | range | int | None = None, **settings: Iterable[Any],
) -> Table:  # fmt: skip
    """Run a scene with all combinations of settings.

    The result is the table of :func:`cohort`.

    Parameters
    ----------
    scene : Scene or path
    out, client, workers, frames
        As of :func:`cohort`.
    **settings : iterable, or a single value
        Values of each setting, as of :meth:`vtkmuscle.Scene.with_settings`. A setting is a column.

    Raises
    ------
    ValueError
        If no setting is given, a setting is unknown, or a value is not allowed.

    Examples
    --------
    >>> import vtkmuscle
    >>> scene = vtkmuscle.Scene.from_phantom(vtkmuscle.phantoms.spindle_over_hinge(), n_fibres=8)
    >>> table = vtkmuscle.vary(scene, workers=1, frames="0:2", deformer=["paths", "none"])
    >>> table.where(deformer="paths")["length_mm"].round()
    array([140.])
    """
    if not settings:
        raise InputError("", "no setting is varied", "give values: vary(scene, n_fibres=[50, 100])")
    scene = scene if isinstance(scene, Scene) else Scene.load(scene)
    frame_numbers(frames, len(scene.motion.times))  # a ValueError, not a row of each run
    labelled = [(values, scene.with_settings(**values)) for values in combinations(settings)]
    return run_labelled(labelled, out, client, workers, None, {"frames": frames})


def combinations(settings: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return all combinations of settings by name. A text or number is a single value."""
    single = str | int | float | None
    every = product(*([each] if isinstance(each, single) else each for each in settings.values()))
    return [dict(zip(settings, values, strict=True)) for values in every]


def run_labelled(
    labelled: Sequence[tuple[Mapping[str, Any], Any]], out: str | PathLike[str] | None, client: Any,
    workers: int | None, progress: Callable[[Sequence[Row]], None] | None, options: Mapping[str, Any],
) -> Table:  # fmt: skip
    """Run labelled scenes, and write the table. The labels are the first columns of the table."""
    of_run = {name: value for name, value in options.items() if name not in ("muscles", *SETTINGS)}
    run_options(of_run | {"workers": workers}, SETTINGS)
    asked = {"figures": False, "report": False, **options, "workers": 1}
    names = [folder_name(labels) for labels, _ in labelled]
    twice = [name for name in names if names.count(name) > 1]
    if not names or twice:
        words = ", ".join(map(str, labelled[names.index(twice[0])][0].values())) if twice else ""
        problem = f"two have the same name, {words!r}" if twice else "there are none"
        raise InputError("scenes", problem, "give each scene and value once, and each subject a name")
    kept, overwrite = None if out is None else Path(out) / "cohort.csv", bool(options.get("overwrite"))
    outputs = None if kept is None else Outputs.for_file(kept, (), overwrite=overwrite)
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory()) if out is None else out)
        folder.mkdir(parents=True, exist_ok=True)
        stack.enter_context(locked(folder))
        tasks = []
        for name, (_, scene) in zip(names, labelled, strict=True):
            if isinstance(scene, Scene):  # run as it is: a saved scene has no joints
                path = scene.save(folder / name / "scene").absolute()
                scene = replace(scene, files={"": path})  # noqa: PLW2901
            tasks.append((scene, None if out is None else folder / name, asked))
        rows: dict[int, list[Row]] = {}
        for number, solved in _solved(tasks, client, workers or processors()):
            rows[number] = [dict(labelled[number][0]) | row for row in solved]
            if progress is not None:
                progress(rows[number])
        listed = [row for number in sorted(rows) for row in rows[number]]
        columns = dict.fromkeys(name for row in listed for name in row)
        table = Table(tuple(columns), [[row.get(name) for name in columns] for row in listed])
    if outputs is not None:
        with outputs:
            table.to_csv(outputs.folder / "cohort.csv", digits=6)
    return table


def _solved(tasks: Sequence[tuple[Any, ...]], client: Any, workers: int) -> Iterator[tuple[int, list[Row]]]:
    """Give number and rows of each finished task, of Dask's client, of processes, or of this process."""
    if client is None and min(workers, len(tasks)) == 1:
        for number, task in enumerate(tasks):
            yield number, _rows(*task)[0]
        return
    with ExitStack() as stack:  # Ctrl-C, or an error in progress(): nobody waits for scenes that still run
        if client is None:
            pool = stack.enter_context(processes(min(workers, len(tasks)), _keep_warnings))
        else:
            pool = client.get_executor(pure=False)
            stack.callback(pool.shutdown, wait=False)  # cancels the tasks that have not begun
        jobs = {pool.submit(_rows, *task): number for number, task in enumerate(tasks)}
        for job in as_completed(jobs):
            try:
                rows, warned = job.result()
            except BrokenExecutor:
                rows, warned = [_words("the process was killed or out of memory; run it again")], []
            for text, category in warned:
                warnings.warn(text, category, stacklevel=5)
            yield jobs[job], rows


def _keep_warnings() -> None:
    """Keep the warnings of this process for its parent."""
    warnings.simplefilter("always")  # the parent process filters them
    warnings.showwarning = lambda text, category, *_, **__: _warned.append((str(text), category))


def _rows(scene: Any, out: Path | None, options: Mapping[str, Any]) -> tuple[list[Row], Warned]:
    """Return the rows of a scene's muscles, and kept warnings. A scene without a finished folder is run."""
    _warned.clear()
    try:
        scene, options = (scene if isinstance(scene, Scene) else Scene.load(scene)).chosen(**options)
        result = None if out is None or options.get("fresh") else _finished(scene, out, options)
        if result is None:
            result = scene.run(out, **options)
    except (ValueError, OSError, MemoryError, RuntimeError) as error:
        words = "; ".join(" ".join(line.split()) for line in str(error).splitlines())
        return [_words(words or type(error).__name__, out)], [*_warned]
    return [_row(result, name, out) for name in scene.muscles], [*_warned]


def _finished(scene: Scene, out: Path, options: Mapping[str, Any]) -> Result | None:
    """Return the result in a folder, None without a complete report of all this scene's muscles.

    None also if a source file has changed, or a page or figures are asked and missing.
    """
    folder, numbers = ResultFolder(out), frame_numbers(options.get("frames"), len(scene.motion.times))
    report, keys = folder.report(), muscle_keys(scene, numbers)
    if report is None or not report["complete"] or report.get("sha256") != digests(scene):
        return None
    there = {"report": (out / PAGE).exists(), "figures": "figures" in report}
    if keys.keys() != folder.finished(keys).keys() or any(options[name] > there[name] for name in there):
        return None
    published = {name: muscle.literature for name, muscle in scene.muscles.items()}  # of a scene in memory
    with suppress(InputError, OSError):  # a changed file: the run writes it again
        result = Result.load(out)
        return result if digest_of(result.literature) == digest_of(published) else None
    return None


def _words(message: str, out: Path | None = None, muscle: str = "", verdict: str = "failed") -> Row:
    """Return the columns that every row has; by default those of a failed scene."""
    return dict(zip(COLUMNS, (muscle, verdict, message, "" if out is None else out.name), strict=True))


def _row(result: Result, name: str, out: Path | None) -> Row:
    """Return the numbers of a muscle by column."""
    muscle, message = result.report["muscles"][name], "; ".join(result[name].reasons)
    row = _words(message, out, name, result.verdicts[name]) | {"frames": len(muscle["frames"])}
    row |= {"seconds": sum(muscle["seconds"].values()), "volume_mm3": muscle.get("volume_mm3")}
    architecture = muscle.get("architecture", {})
    row |= {key: architecture[key] for key in ("pcsa_mm2", "pcsa_without_tendon_mm2") if key in architecture}
    lengths = {"length": result.lengths, "fibre_length": result.fibre_lengths}
    means = {quantity: rows[name].mean(axis=1) for quantity, rows in lengths.items() if name in rows}
    means |= {f"moment_arm_{axis}": joint.mean for axis, joint in result.all_arms.get(name, {}).items()}
    settled = ((quantity, mean[np.isfinite(mean)]) for quantity, mean in means.items())
    parts = ("", np.mean), ("_least", np.min), ("_largest", np.max)
    return row | {f"{of}{part}_mm": float(a(mean)) for of, mean in settled if len(mean) for part, a in parts}


def folder_name(labels: Mapping[str, Any]) -> str:
    """Return the folder name of labels: readable letters, and a digest of all."""
    name = ", ".join(map(str, labels.values()))
    readable = re.sub(r"[^A-Za-z0-9.-]+", "_", name).strip("._")[-_LONGEST:]
    return f"{readable}-{hashlib.sha256(name.encode()).hexdigest()[:16]}"
