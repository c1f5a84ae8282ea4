"""Names that can be part of file names, on every system and beside all other files of a run."""

from __future__ import annotations

import re
from pathlib import Path

from vtkmuscle.scene.model import SceneError

#: Letters, digits, and a few signs that every file system takes.
_NAME = re.compile(r"\w[\w .+-]*(?<![ .])")

#: Files of these names cannot be made on Windows, whatever their suffix.
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)

#: A folder of such a name might be where a file of results goes, or the other way round.
_RESULTS = (".pvd", ".vtkhdf", ".vtp", ".csv", ".json", ".png", ".toml", ".html", ".partial")

#: Bytes of a name: file systems take 255, of which the parts that are added need some.
_LONGEST = 150


def check_name(name: str, key: str, file: Path | None) -> None:
    """Raise a SceneError where a name cannot be part of the names of files.

    Parameters
    ----------
    name : str
        Of a scene, a bone or a muscle.
    key : str
        Where it stands.
    file : Path or None
        The scene's file.

    Raises
    ------
    SceneError
        If it cannot; says why.
    """
    mend = "use letters, digits, spaces and _ - + . only, beginning and ending with a letter or digit"
    shown = key if key.isprintable() else ascii(key)[1:-1]
    if not _NAME.fullmatch(name):
        raise SceneError(f"{name!r} cannot be part of a file name", key=shown, mend=mend, file=file)
    if _DEVICES.fullmatch(name):
        problem = f"{name!r} cannot be the name of a file on Windows"
        raise SceneError(problem, key=shown, mend="call it otherwise", file=file)
    if name.casefold().endswith(_RESULTS):
        problem = f"{name!r} ends like a file of results, and would be in the way of one"
        raise SceneError(problem, key=shown, mend="leave out the suffix", file=file)
    if len(name.encode()) > _LONGEST:
        problem = f"a name of {len(name)} letters is too long for a file"
        raise SceneError(problem, key=shown[:60], mend=f"use at most {_LONGEST}", file=file)
