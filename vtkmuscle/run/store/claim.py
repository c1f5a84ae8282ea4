"""A folder that a run may write to: nobody else's, and with nothing in it that would be lost."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from typing import Any

from vtkmuscle.core.errors import InputError
from vtkmuscle.io.writing import check_no_links, left_behind, locked
from vtkmuscle.run.store import FINISHED, PAGE, REPORT, SCENE, ResultFolder
from vtkmuscle.scene.data import SceneData
from vtkmuscle.scene.schema_types import checked_name

#: Tables and pages of a run, beside those that are called after muscles; and its folders, likewise.
_LISTS = (
    *("lengths.csv", "fibre_lengths.csv", "architecture.csv"),
    *("moment_arms.csv", "moment_arms_summary.csv", PAGE),
)
_FOLDERS = ("bones", "figures", FINISHED)


@contextmanager
def claimed(folder: Path, scene: SceneData, *, overwrite: bool) -> Iterator[None]:
    """Make a folder for the results of a scene, and hold it against other runs.

    Nothing in it is changed, but half-written files of killed runs go. With ``overwrite`` results of another
    scene, and files that no run has written, may be replaced; inputs of the scene never are.

    Raises
    ------
    OSError
        If it cannot be made, another run is writing to it, or something in it is in the way.
    ValueError
        If something in it would be lost.
    """
    if folder.is_symlink() and not folder.exists():
        raise FileNotFoundError(f"{folder} is a link to {os.readlink(folder)}, which does not exist")
    if folder.exists() and not folder.is_dir():
        raise NotADirectoryError(f"{folder} is a file; give another folder for the results")
    _check_inputs(folder, scene)
    folder.mkdir(parents=True, exist_ok=True)
    with locked(folder):
        report = ResultFolder(folder).report()
        for path in map(folder.joinpath, _folders([*scene.muscles, *_muscles_of(report)])):
            check_no_links(path)
            if path.exists() and not path.is_dir():
                raise NotADirectoryError(f"{path} is a file, where a folder of results goes; move it away")
        for path in map(folder.joinpath, _files(scene.muscles)):
            if path.is_dir() and not path.is_symlink():
                raise IsADirectoryError(f"{path} is a folder, where a file of results goes; move it")
        inside = (left_behind(folder / name, deep=True) for name in _folders(scene.muscles))
        for left in chain(left_behind(folder), *inside):
            shutil.rmtree(left) if left.is_dir() else left.unlink(missing_ok=True)
        if not overwrite:
            _check_results(folder, scene, report)
        yield


def remove_results(folder: Path, scene: SceneData, kept: Collection[str] = ()) -> None:
    """Remove the results of an earlier run from a claimed folder, so that nothing old stands beside the new.

    These are files by the names that runs give: of the muscles of the scene and of those that the report
    names, but for those that are ``kept``; of the bones that are noted; and figures that the report lists.
    """
    report = ResultFolder(folder).report() or {}
    notes = folder / FINISHED
    muscles = {*scene.muscles, *_muscles_of(report)}
    gone = sorted(muscles - {*kept})
    bones = sorted({*scene.bones, *(note.stem for note in (notes / "bones").glob("*.vtp"))})
    # Notes first: what is noted is there.
    files = [notes / f"{name}{end}" for name in (SCENE, *gone) for end in (".npz", ".vtp", "_fibres.vtp")]
    files += [*(notes / "bones").glob("*.vtp"), *(folder / name for name in _LISTS)]
    files += [folder / f"{name}_fibres.csv" for name in muscles]
    folders = [folder / "bones" / name for name in bones]
    folders += [folder / name for one in gone for name in (one, f"{one}_fibres")]
    for inside in folders:
        frame = re.compile(re.escape(inside.name) + r"_\d{4,}\.vtp")
        found = list(inside.iterdir()) if inside.is_dir() else []
        files += [path for path in found if frame.fullmatch(path.name)]
        files.append(inside.with_name(f"{inside.name}.pvd"))
    files.append(folder / "bones.pvd")
    files += [folder / "bones" / f"{name}.vtp" for name in bones]
    drawn = report.get("figures")
    names = drawn.get("written", ()) if isinstance(drawn, dict) else ()
    files += [folder / "figures" / Path(str(figure)).name for figure in names]
    for file in files:
        if file.is_symlink() or file.is_file():
            file.unlink()
    for inside in (*folders, folder / "bones"):
        remove_if_empty(inside)


def remove_if_empty(folder: Path) -> None:
    """Remove a folder with nothing in it; others stay."""
    if folder.is_dir() and not any(folder.iterdir()):
        folder.rmdir()


def scene_file(scene: SceneData) -> str | None:
    """Return where a scene was read from, in full; None where it was made in Python."""
    return str(scene.files[""].resolve()) if "" in scene.files else None


def _folders(muscles: Iterable[str]) -> list[str]:
    """Return the folders that a run makes in its own."""
    return [*_FOLDERS, *(part for name in muscles for part in (name, f"{name}_fibres"))]


def _files(muscles: Iterable[str]) -> list[str]:
    """Return the files that a run writes to its folder itself."""
    names = list(muscles)
    series = ["bones", *(part for name in names for part in (name, f"{name}_fibres"))]
    tables = (f"{name}_fibres.csv" for name in names)
    return [REPORT, *_LISTS, *(f"{one}.pvd" for one in series), *tables]


def _muscles_of(report: Mapping[str, Any] | None) -> Iterator[str]:
    """Give the muscles of an earlier run; a name that no run could have written is passed over."""
    for name in (report or {}).get("muscles", ()):
        with suppress(ValueError):
            yield checked_name(name)


def _check_inputs(folder: Path, scene: SceneData) -> None:
    """Raise a ValueError where a file that the scene is read from lies where results go."""
    written = {*_folders(scene.muscles), *_files(scene.muscles)}
    for key, file in scene.files.items():
        for path in {file.resolve(), Path(os.path.abspath(file))}:
            for base in {folder.resolve(), Path(os.path.abspath(folder))}:
                if base in path.parents and path.relative_to(base).parts[0] in written:
                    raise InputError(
                        file,
                        f"the results in {folder} would be written over this input of the scene"
                        f"{f' ({key})' if key else ''}",
                        "give another folder with --out",
                    )


def _check_results(folder: Path, scene: SceneData, report: Mapping[str, Any] | None) -> None:
    """Raise a ValueError where there are results of another scene, or files that no run has written."""
    insist = "give another folder with --out, or --overwrite (overwrite=True) to replace them"
    if report is None:
        for path in map(folder.joinpath, (*_files(scene.muscles), *_folders(scene.muscles))):
            if path.is_file() or path.is_symlink() or (path.is_dir() and _may_lose(path)):
                raise InputError(path, "results would be written over what no run has made", insist)
        return
    before, now = report.get("scene_file"), scene_file(scene)
    if report.get("scene") != scene.name or (before and now and before != now):
        of = f" of {before}" if before else ""
        raise InputError(folder, f"it holds the results of the scene {report.get('scene')!r}{of}", insist)


def _may_lose(folder: Path) -> bool:
    """Return whether a folder holds what a run might write over: frames, figures, or folders of them."""
    return any(path.is_dir() or path.suffix.lower() in (".vtp", ".png") for path in folder.iterdir())
