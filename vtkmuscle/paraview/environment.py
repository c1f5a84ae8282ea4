"""What has to be set for ParaView to find the plugin and the packages that it needs."""

from __future__ import annotations

import hashlib
import os
import sys
from importlib import metadata
from pathlib import Path

import vtkmuscle
from vtkmuscle.core.grid_cache import FOLDER_VARIABLE, cache_folder

_HERE = Path(__file__).resolve().parent
#: What ParaView loads at start-up.
PLUGINS = _HERE / "plugins"
#: What lets ParaView 5.11 load Python plugins at all where its Python is 3.11.
MEND = _HERE / "mend_5_11"
#: What the filters need beside vtkmuscle; where one is not installed its filters say so.
DISTRIBUTIONS = ("numpy", "scipy", "numba", "llvmlite", "fast-simplification")


def default_folder() -> Path:
    """Return the folder that links are made in: one for each Python environment, in the user's cache.

    Raises
    ------
    ValueError
        If there is no cache folder.
    """
    cache = cache_folder()
    if cache is None:
        raise ValueError(f"there is no cache folder ({FOLDER_VARIABLE} is empty); give one with --folder")
    environment = hashlib.sha256(sys.prefix.encode()).hexdigest()[:8]
    return cache / f"paraview-py{sys.version_info.major}.{sys.version_info.minor}-{environment}"


def link_packages(folder: Path) -> None:
    """Fill a folder with links to vtkmuscle and to the packages it needs in ParaView, and to no others.

    The environment's own site-packages is no folder for ParaView: the VTK in it would take the place of
    ParaView's.

    Parameters
    ----------
    folder : path
        Made where it does not exist; links in it are replaced.

    Raises
    ------
    ValueError
        If something is in the folder that is not a link.
    OSError
        If a link cannot be made.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.iterdir():
        if not old.is_symlink():
            raise ValueError(f"{folder}: {old.name} is not a link; give a folder of its own with --folder")
        old.unlink()
    package = Path(vtkmuscle.__file__).resolve().parent
    (folder / package.name).symlink_to(package)
    for name in DISTRIBUTIONS:
        for target in _top_level(name):
            (folder / target.name).symlink_to(target)


def _top_level(name: str) -> set[Path]:
    """Return the files and folders in site-packages that a distribution consists of."""
    try:
        distribution = metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return set()
    names = {path.parts[0] for path in distribution.files or () if path.parts[0] not in ("..", "__pycache__")}
    return {Path(str(distribution.locate_file(part))).resolve() for part in names}


def settings(folder: Path) -> dict[str, list[Path]]:
    """Return the environment variables for ParaView, each a list of folders.

    Parameters
    ----------
    folder : path
        With the packages.

    Returns
    -------
    dict of str to list of Path
        ``PV_PLUGIN_PATH`` and ``PYTHONPATH``.
    """
    return {"PV_PLUGIN_PATH": [PLUGINS], "PYTHONPATH": [MEND, folder]}


def shell_commands(folder: Path) -> list[str]:
    """Return the commands that set these variables, before what they hold already.

    Parameters
    ----------
    folder : path
        With the packages.

    Returns
    -------
    list of str
        For a POSIX shell, or for cmd.exe on Windows.
    """
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
