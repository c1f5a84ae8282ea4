"""No code is loaded from the working folder, which may hold a scene from elsewhere."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def leave_out_working_folder() -> None:
    """Remove the working folder from the places that code is loaded from; for the command line.

    ``python -m`` puts the working folder first on Python's path, and so does an empty part of ``PYTHONPATH``;
    a folder that stands there by its full name was given on purpose and stays. Numba reads a file
    ``.numba_config.yaml`` in the working folder, which could load compiled code from anywhere: the
    environment overrides it.
    """
    here = os.path.realpath(os.getcwd())
    if here not in map(os.path.realpath, _asked_for()):
        sys.path[:] = [part for part in sys.path if os.path.realpath(part or ".") != here]
    os.environ.setdefault("NUMBA_CACHE_DIR", "")


@contextmanager
def workers_leave_out_working_folder() -> Iterator[None]:
    """Let processes started meanwhile by :mod:`multiprocessing` load nothing from it either.

    Each begins as ``python -c``, which looks there for ``multiprocessing`` itself.
    """
    changed = {"PYTHONSAFEPATH": "1", "PYTHONPATH": os.pathsep.join(_asked_for())}
    before = {name: os.environ.get(name) for name in changed}
    os.environ.update(changed)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _asked_for() -> list[str]:
    """Return the folders that stand in ``PYTHONPATH`` by their full names."""
    return [part for part in os.environ.get("PYTHONPATH", "").split(os.pathsep) if os.path.isabs(part)]


def is_python() -> bool:
    """Return whether this program is a Python to be started again; ParaView names itself, or no file."""
    program = Path(sys.executable or "-")
    return program.name.startswith("python") and program.is_file()


def isolated_python(code: str) -> list[str]:
    """Return the command for :func:`subprocess.run` that runs code in a new Python with the same packages.

    Neither the working folder nor the environment adds to where it loads code from.
    """
    path = [os.path.abspath(part) for part in sys.path if part]
    return [sys.executable, "-I", "-c", f"import sys\nsys.path[:] = {path!r}\n{code}"]
