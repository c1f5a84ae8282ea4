"""Names that can be part of file names, on every system and beside all other files of a run."""

from __future__ import annotations

import re

from vtkmuscle.core.words import shown
from vtkmuscle.scene.settings import fault

#: Letters, digits, and a few signs that every file system takes.
_NAME = re.compile(r"\w[\w .+-]*(?<![ .])")

#: Files of these names cannot be made on Windows, whatever their suffix.
_DEVICES = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)

#: A folder of such a name might be where a file of results goes, or the other way round.
_RESULTS = (".pvd", ".vtkhdf", ".vtp", ".csv", ".json", ".png", ".toml", ".html", ".partial")

#: Bytes of a name: file systems take 255, of which the parts that are added need some.
_LONGEST = 150


def checked_name(name: str) -> str:
    """Return a name of a scene, a bone or a muscle; raise a fault where no file could be called so."""
    if not _NAME.fullmatch(name):
        remedy = "use letters, digits, spaces and _ - + . only, beginning and ending with a letter or digit"
        raise fault(f"{shown(name)} cannot be part of a file name", remedy)
    if _DEVICES.fullmatch(name):
        raise fault(f"{name!r} cannot be the name of a file on Windows", "give it another name")
    if name.casefold().endswith(_RESULTS):
        problem = f"{shown(name)} ends like a file of results, and would be in the way of one"
        raise fault(problem, "leave out the suffix")
    if len(name.encode()) > _LONGEST:
        raise fault(f"a name of {len(name)} letters is too long for a file", f"use at most {_LONGEST}")
    return name
