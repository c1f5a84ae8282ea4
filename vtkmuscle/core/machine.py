"""The machine: how many processors there are, and where what is compiled and linked is kept between runs."""

from __future__ import annotations

import errno
import os
import stat
import warnings
from pathlib import Path

#: Where the cache is, instead of the user's cache folder; empty for no cache.
FOLDER_VARIABLE = "VTKMUSCLE_CACHE"


def cache_folder() -> Path | None:
    """Return the folder of all that is kept between runs, None where nothing is to be.

    That is the environment variable ``VTKMUSCLE_CACHE`` where it is set (empty: no cache), else
    ``vtkmuscle`` in the user's cache folder (``XDG_CACHE_HOME``, else ``~/.cache``).

    Returns
    -------
    Path or None
        It need not exist yet.

    Examples
    --------
    >>> from unittest.mock import patch
    >>> with patch.dict("os.environ", VTKMUSCLE_CACHE="somewhere"):
    ...     cache_folder().name
    'somewhere'
    """
    chosen = os.environ.get(FOLDER_VARIABLE)
    if chosen is not None:
        return Path(chosen).expanduser() if chosen else None
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(base) if base else Path.home() / ".cache") / "vtkmuscle"
    except RuntimeError:  # there is no home
        return None


def check_nobody_else_writes(found: os.stat_result) -> None:
    """Raise an error unless a file or folder is this user's or the system's, and no other user may change it.

    Parameters
    ----------
    found : os.stat_result
        What the system knows of it.

    Raises
    ------
    PermissionError
        If another user could have put something there. Not on Windows, where a mode does not say.
    """
    if os.name != "posix":
        return
    if found.st_uid not in (os.geteuid(), 0):
        raise PermissionError(errno.EPERM, "it belongs to another user")
    if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise PermissionError(errno.EPERM, "other users can write to it")


_unusable: set[tuple[Path, str]] = set()


def warn_of_folder(folder: Path, error: OSError, what: str, consequence: str) -> None:
    """Warn, once per folder, that nothing can be kept in it, and of the consequence."""
    if (folder, what) not in _unusable:
        _unusable.add((folder, what))
        warnings.warn(
            f"{what} cannot be kept in {folder} ({error.strerror or error}), so they are {consequence}; set "
            f"{FOLDER_VARIABLE} to a folder that can be written to, or to nothing",
            stacklevel=4,
        )


def processors() -> int:
    """Return the number of processors: a job of a cluster, or a container, may have some of them only."""
    if hasattr(os, "sched_getaffinity"):  # not known to macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
