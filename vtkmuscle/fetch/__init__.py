"""Public data sets as scenes: downloaded from where they are published, checked, and put together.

A data set is a module here that gives its licence, its files and how these become a scene, and an entry of
:data:`DATA_SETS`.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import suggestion
from vtkmuscle.fetch.datasets import DataSet, RemoteFile
from vtkmuscle.fetch.lhdl_hip import LHDL_HIP
from vtkmuscle.io import write_text
from vtkmuscle.io.parts import file_digest
from vtkmuscle.scenes import Scene

__all__ = ["DATA_SETS", "HOST", "DataSet", "RemoteFile", "data_set", "fetch"]

DATA_SETS: dict[str, DataSet] = {"lhdl-hip": LHDL_HIP}
#: The server of raw files of public repositories.
HOST = "https://raw.githubusercontent.com"


def data_set(name: str) -> DataSet:
    """Return a data set by its name; raise an InputError where there is none."""
    if name not in DATA_SETS:
        raise InputError("", f"there is no data set {name!r}; {suggestion(name, DATA_SETS)}")
    return DATA_SETS[name]


def fetch(
    name: str,
    folder: str | PathLike[str] | None = None,
    *,
    accept_licence: bool = False,
    host: str = HOST,
    announce: Callable[[str], None] = lambda words: None,
) -> Path:
    """Download a public data set and write it as a scene.

    Files come from pinned commits of the repositories where they are published. Each is checked: by its
    SHA-256, or where that is not known by its content. A failed download is tried again twice. If anything
    fails, nothing is left behind.

    Parameters
    ----------
    name : str
        ``"lhdl-hip"``, or another one of :data:`vtkmuscle.fetch.DATA_SETS`.
    folder : path, optional
        Folder of the scene, which must not exist yet. By default ``name`` in the working folder.
    accept_licence : bool, optional
        Whether you accept ``vtkmuscle.fetch.DATA_SETS[name].licence``.
    host : str, optional
        A mirror, which serves ``OWNER/REPOSITORY/COMMIT/PATH``.
    announce : callable, optional
        Called with a line of text for each file.

    Returns
    -------
    Path
        The scene.toml. Beside it are ``LICENCE.txt`` and ``sources.json``: the address of each file and its
        SHA-256.

    Raises
    ------
    InputError
        If the licence is not accepted, the folder exists, or a file cannot be downloaded or is not the
        published one.

    Examples
    --------
    >>> from vtkmuscle.fetch import fetch
    >>> fetch("lhdl-hip")
    Traceback (most recent call last):
        ...
    vtkmuscle.core.errors.InputError: lhdl-hip: its licence is not accepted; if you accept it say ...
    """
    data = data_set(name)
    if not accept_licence:
        raise InputError(name, "its licence is not accepted", "if you accept it say accept_licence=True")
    target = Path(folder or name)
    if target.exists() or target.is_symlink():
        raise InputError(target, "this is in the way", "remove it, or name another folder")
    target.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as beside:
        source, staging = Path(beside) / "source", Path(beside) / "scene"
        staging.mkdir()
        files, sources = {}, []
        for number, file in enumerate(data.files, start=1):
            url = file.url(host)
            announce(f"{number} of {len(data.files)}: {url}")
            files[file.name] = path = file.download(source, host)
            sources.append({"url": url, "sha256": file_digest(path), "known": bool(file.sha256)})
        announce("putting the scene together")
        scene = data.build(files, staging).relative_to(staging)
        Scene.load(staging / scene)
        write_text(staging / "LICENCE.txt", data.licence)
        write_text(staging / "sources.json", json.dumps(sources, indent=1) + "\n")
        staging.rename(target)
    return target / scene
