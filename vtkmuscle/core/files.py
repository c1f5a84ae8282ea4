"""Files that can be read: they are there, they are files, and they are not larger than they can be."""

from __future__ import annotations

from pathlib import Path

from vtkmuscle.core.errors import InputError, MissingFileError

#: What a mesh, a series or a table may take [bytes].
MOST_BYTES = 4 * 1024**3

#: What a scene, a template or a list of landmarks may take: more is something else [bytes].
MOST_TEXT = 64 * 1024**2


def check_name(path: Path) -> None:
    """Raise an InputError for a path that is no text in UTF-8: nothing that is written could name it."""
    try:
        str(path.absolute()).encode()
    except UnicodeEncodeError:
        raise InputError(
            ascii(str(path))[1:-1], "this path is not text in UTF-8", "rename the file or folder"
        ) from None


def check_is_file(path: Path, *, most: int = MOST_BYTES) -> None:
    """Raise an error that gives the cause where there is no file to read.

    A named pipe would be waited for, and a device be read for ever: neither is a file.

    Parameters
    ----------
    path : Path
        The file.
    most : int, optional
        What it may take [bytes].

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is too large.
    """
    check_name(path)
    if path.is_file():
        size = path.stat().st_size
        if size > most:
            raise InputError(
                path,
                f"the file takes {size / 1024**2:.0f} MB, but at most {most // 1024**2} MB are read",
                "check that it is what its name says",
            )
        return
    if path.is_dir():
        raise MissingFileError(path, "this is a folder, not a file")
    if path.exists():
        raise MissingFileError(path, "this is a pipe or a device, not a file", "copy what it gives to one")
    near = path.parent if path.parent.is_dir() else None
    also = sorted(p.name for p in near.iterdir() if p.suffix == path.suffix)[:5] if near else []
    hint = f"its folder holds {', '.join(also)}" if also else ""
    raise MissingFileError(path, "there is no such file", hint)
