"""Nothing is executed from the folder that somebody works in: it may hold a scene from elsewhere."""

from __future__ import annotations

import os
import sys


def leave_out_working_folder() -> None:
    """Take the working folder off the places that code is loaded from; for the command line.

    ``python -m`` puts the working folder first on Python's path, and so does an empty part of
    ``PYTHONPATH``; a folder that stands there by its full name was asked for and stays. Numba reads a file
    ``.numba_config.yaml`` in the working folder, which could have it load compiled code from anywhere: the
    environment counts more.
    """
    here = os.path.realpath(os.getcwd())
    asked_for = [
        part for part in os.environ.get("PYTHONPATH", "").split(os.pathsep) if part and os.path.isabs(part)
    ]
    if here not in map(os.path.realpath, asked_for):
        sys.path[:] = [part for part in sys.path if os.path.realpath(part or ".") != here]
    os.environ.setdefault("NUMBA_CACHE_DIR", "")


def isolated_python(code: str) -> list[str]:
    """Return the command that runs code in a Python of its own, which finds the packages that this one finds.

    Neither the working folder nor the environment adds to where it loads code from.

    Parameters
    ----------
    code : str
        What to run.

    Returns
    -------
    list of str
        For :func:`subprocess.run`.
    """
    path = [os.path.abspath(part) for part in sys.path if part]
    return [sys.executable, "-I", "-c", f"import sys\nsys.path[:] = {path!r}\n{code}"]
