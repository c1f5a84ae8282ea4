"""A folder that a run may write to: nobody else's, and with nothing in it that would be lost."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.files import check_is_file
from vtkmuscle.io.temporal import SERIES_SUFFIXES
from vtkmuscle.io.writing import check_no_links, left_behind, locked
from vtkmuscle.scene.names import checked_name

if TYPE_CHECKING:
    from vtkmuscle.scene.data import SceneData

#: The page with all that a run has found.
PAGE = "report.html"

#: Tables and folders of a run, beside those that are called after muscles.
_LISTS = (
    "lengths.csv",
    "fibre_lengths.csv",
    "architecture.csv",
    "moment_arms.csv",
    "moment_arms_summary.csv",
    PAGE,
)
_FILES = ("report.json", *_LISTS, "bones.pvd", "bones.vtkhdf")
_FOLDERS = ("bones", "figures", "finished")
_TABLES = ("_fibres.csv",)
#: Endings of the notes of a finished muscle.
_NOTES = (".npz", ".vtp", "_fibres.vtp")


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
        for path in _places([*scene.muscles, *_muscles_of(read_report(folder))], folder=True):
            _check_is_folder(folder / path)
        for path in _places(scene.muscles, folder=False):
            if (folder / path).is_dir() and not (folder / path).is_symlink():
                raise IsADirectoryError(f"{folder / path} is a folder, where a file of results goes; move it")
        inside = (left_behind(folder / name, deep=True) for name in _places(scene.muscles, folder=True))
        for left in chain(left_behind(folder), *inside):
            shutil.rmtree(left) if left.is_dir() else left.unlink(missing_ok=True)
        if not overwrite:
            _check_results(folder, scene)
        yield


def remove_results(folder: Path, scene: SceneData, kept: Collection[str] = ()) -> None:
    """Remove the results of an earlier run from a claimed folder, so that nothing old stands beside the new.

    That is the report, the tables, and the series with the frames that they list, of the muscles of the
    scene and of those that the report names, but for those that are ``kept``; and the figures that the
    report lists.
    """
    report = read_report(folder) or {}
    names = {*scene.muscles, *_muscles_of(report)}
    notes = folder / "finished"
    for note in (notes / f"{name}{end}" for name in ("scene", *names - {*kept}) for end in _NOTES):
        note.unlink(missing_ok=True)  # first: what is noted is there
    for inside, ending in (("bones", ".vtp"), ("errors", ".npz")):
        for note in (notes / inside).glob(f"*{ending}"):
            note.unlink()
    gone = sorted(names - {*kept})
    for number, series in enumerate(("bones", *gone, *(f"{name}_fibres" for name in gone))):
        _remove_series(folder, series, numbered=number > 0)
    for name in sorted(names):
        for ending in _TABLES:
            (folder / f"{name}{ending}").unlink(missing_ok=True)
    drawn = report.get("figures")
    for figure in drawn.get("written", ()) if isinstance(drawn, dict) else ():
        path = folder / "figures" / Path(str(figure)).name
        if path.is_file():
            path.unlink()
    for name in _LISTS:
        (folder / name).unlink(missing_ok=True)


def _remove_series(folder: Path, name: str, *, numbered: bool) -> None:
    """Remove a series and the frames that it lists; of muscles also those that no series lists yet."""
    inside = folder / name
    frames = set(_listed(folder / f"{name}.pvd"))
    if numbered and inside.is_dir():
        pattern = re.compile(re.escape(name) + r"_\d{4,}\.vtp")
        frames |= {path for path in inside.iterdir() if pattern.fullmatch(path.name)}
    parents = set()
    for frame in frames:
        if inside in frame.parents and ".." not in frame.parts and frame.suffix == ".vtp":
            frame.unlink(missing_ok=True)
            parents.add(frame.parent)
    for parent in sorted({*parents, inside}, key=lambda path: -len(path.parts)):
        if parent.is_dir() and not any(parent.iterdir()):
            parent.rmdir()
    for ending in SERIES_SUFFIXES:
        (folder / f"{name}{ending}").unlink(missing_ok=True)


def _listed(collection: Path) -> Iterator[Path]:
    """Give the files that a .pvd lists; none where it is damaged."""
    try:
        entries = list(ElementTree.parse(collection).getroot().iter("DataSet"))
    except (OSError, ElementTree.ParseError):
        return
    for entry in entries:
        if entry.get("file"):
            yield collection.parent / str(entry.get("file"))


def _muscles_of(report: Mapping[str, Any] | None) -> Iterator[str]:
    """Give the muscles of an earlier run; a name that no run could have written is passed over."""
    for name in (report or {}).get("muscles", ()):
        with suppress(ValueError):
            yield checked_name(name)


def _places(muscles: Iterable[str], *, folder: bool) -> Iterator[str]:
    """Give the names of folders, or of files, that a run writes in its folder."""
    yield from _FOLDERS if folder else _FILES
    for name in muscles:
        for part in (name, f"{name}_fibres"):
            if folder:
                yield part
            else:
                yield from (part + ending for ending in SERIES_SUFFIXES)
        if not folder:
            yield from (name + ending for ending in _TABLES)


def _check_inputs(folder: Path, scene: SceneData) -> None:
    """Raise a ValueError where a file that the scene is read from lies where results go."""
    root = folder.resolve()
    written = {*_places(scene.muscles, folder=True), *_places(scene.muscles, folder=False)}
    for key, file in scene.files.items():
        for path in {file.resolve(), Path(os.path.abspath(file))}:
            for base in {root, Path(os.path.abspath(folder))}:
                inside = base in path.parents and path.relative_to(base).parts[0] in written
                if inside:
                    raise InputError(
                        file,
                        f"the results in {folder} would be written over this input of the scene"
                        f"{f' ({key})' if key else ''}",
                        "give another folder with --out",
                    )


def _check_is_folder(path: Path) -> None:
    check_no_links(path)
    if path.exists() and not path.is_dir():
        raise NotADirectoryError(f"{path} is a file, where a folder of results goes; move it away")


def _check_results(folder: Path, scene: SceneData) -> None:
    """Raise a ValueError where there are results of another scene, or files that no run has written."""
    insist = "give another folder with --out, or --overwrite (overwrite=True) to replace them"
    report = read_report(folder)
    if report is None:
        places = [*_places(scene.muscles, folder=False), *_places(scene.muscles, folder=True)]
        for path in map(folder.joinpath, places):
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


def scene_file(scene: SceneData) -> str | None:
    """Return where a scene was read from, in full; None where it was made in Python."""
    return str(scene.files[""].resolve()) if "" in scene.files else None


def read_report(folder: Path) -> dict[str, Any] | None:
    """Return the report of a run from its folder, None where there is none."""
    try:
        check_is_file(folder / "report.json")
        report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    good = isinstance(report, dict) and isinstance(report.get("muscles"), dict) and "complete" in report
    return report if good else None
