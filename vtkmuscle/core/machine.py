"""The machine: processors, Python, and cache folder."""

import os
import sys
from pathlib import Path

#: Environment variable that names the cache folder; empty for no cache.
FOLDER_VARIABLE = "VTKMUSCLE_CACHE"


def cache_folder() -> Path | None:
    """Return the cache folder, None without a cache.

    The environment variable ``VTKMUSCLE_CACHE`` if set (empty: no cache). By default ``vtkmuscle`` in the
    user's cache folder (``XDG_CACHE_HOME``, by default ``~/.cache``). The folder need not exist.
    """
    chosen = os.environ.get(FOLDER_VARIABLE)
    if chosen is not None:
        return Path(chosen).expanduser() if chosen else None
    base = os.environ.get("XDG_CACHE_HOME")
    try:
        return (Path(base) if base else Path.home() / ".cache") / "vtkmuscle"
    except RuntimeError:  # there is no home
        return None


def is_python() -> bool:
    """Return whether this program is Python; ParaView gives its own name, or no file, as interpreter."""
    program = Path(sys.executable or "-")
    return program.name.startswith("python") and program.is_file()


def python_command(code: str) -> list[str]:
    """Return the command that runs code in a new Python, which ignores the working folder."""
    return [sys.executable, "-P", "-c", f"import sys\n{code}"]


def processors() -> int:
    """Return the number of available processors; a container may give a process a part of all."""
    if hasattr(os, "sched_getaffinity"):  # not known to macOS and Windows
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
