"""Environment variables with which ParaView finds the plugin and its packages."""

import hashlib
import os
import sys
from importlib import metadata
from pathlib import Path

import vtkmuscle
from vtkmuscle.core.machine import FOLDER_VARIABLE, cache_folder
from vtkmuscle.io.writing import record_in, write_json

_HERE = Path(__file__).resolve().parent
#: Folder that ParaView loads at start-up.
PLUGINS = _HERE / "plugins"
#: Folder that enables Python plugins in ParaView 5.11 with Python 3.11.
COMPATIBILITY = _HERE / "compatibility_5_11"
#: Packages for filters and scenes besides vtkmuscle; a missing package is reported on use.
DISTRIBUTIONS = (
    *("numpy", "scipy", "numba", "llvmlite", "lazy-loader", "tomli-w", "robust-laplacian"),
    *("pydantic", "pydantic-core", "annotated-types", "typing-extensions", "typing-inspection"),
)
#: File with the links made in a folder.
_RECORD = ".made_by_vtkmuscle.json"


def default_folder() -> Path:
    """Return the cache folder for links of this environment."""
    cache = cache_folder()
    if cache is None:
        raise ValueError(f"there is no cache folder ({FOLDER_VARIABLE} is empty); give one with --folder")
    environment = hashlib.sha256(sys.prefix.encode()).hexdigest()[:8]
    return cache / f"paraview-py{sys.version_info.major}.{sys.version_info.minor}-{environment}"


def link_packages(folder: Path) -> None:
    """Fill a folder with links to packages for ParaView.

    The environment's site-packages would replace ParaView's VTK. A file lists the links made here; only
    listed links are ever removed. ValueError if the folder contains other files; it is unchanged then.
    """
    package = Path(vtkmuscle.__file__).resolve().parent
    targets = {package, *(target for name in DISTRIBUTIONS for target in _top_level(name))}
    wanted = {target.name: str(target) for target in targets}
    folder.mkdir(parents=True, exist_ok=True)
    ours = record_in(folder / _RECORD)
    for old in sorted(folder.iterdir()):
        if old.name == _RECORD:
            continue
        what = "is not a link" if not old.is_symlink() else "is a link of another program"
        if not old.is_symlink() or os.readlink(old) not in (ours.get(old.name), wanted.get(old.name)):
            raise ValueError(f"{folder}: {old.name} {what}; give a separate folder with --folder")
    # The record comes first, so that it also lists the links of an interrupted call.
    write_json(folder / _RECORD, ours | wanted)
    for name in {*ours, *wanted}:
        if (folder / name).is_symlink() and os.readlink(folder / name) != wanted.get(name):
            (folder / name).unlink()
    for name, target in wanted.items():
        if not (folder / name).is_symlink():
            (folder / name).symlink_to(target)
    write_json(folder / _RECORD, wanted)


def _top_level(name: str) -> set[Path]:
    """Return a distribution's files and folders in site-packages."""
    try:
        distribution = metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return set()
    names = {path.parts[0] for path in distribution.files or () if path.parts[0] not in ("..", "__pycache__")}
    return {Path(str(distribution.locate_file(part))).resolve() for part in names}


def settings(folder: Path) -> dict[str, list[Path]]:
    """Return ParaView's environment variables as lists of folders."""
    return {"PV_PLUGIN_PATH": [PLUGINS], "PYTHONPATH": [COMPATIBILITY, folder]}


def shell_commands(folder: Path) -> list[str]:
    """Return shell commands that set the variables. The shell is POSIX, or cmd.exe on Windows."""
    version = f"{sys.version_info.major}.{sys.version_info.minor}"
    lines = [f"{'rem' if os.name == 'nt' else '#'} for a ParaView whose Python is {version}"]
    for name, folders in settings(folder).items():
        joined = os.pathsep.join(str(path) for path in folders)
        if os.name == "nt":
            lines.append(f"set {name}={joined};%{name}%")
        else:
            quoted = "'" + joined.replace("'", "'\\''") + "'"
            lines.append(f'export {name}={quoted}"${{{name}:+:${name}}}"')
    return lines
