"""Public data sets by name, downloaded and put together as scenes, all or nothing."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path

import requests

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import suggestion
from vtkmuscle.fetch.datasets import AGAIN, DataSet, RemoteFile
from vtkmuscle.fetch.lhdl_hip import LHDL_HIP
from vtkmuscle.io import write_text
from vtkmuscle.io.parts import file_digest
from vtkmuscle.io.writing import beside, left_behind
from vtkmuscle.scenes import Scene

DATA_SETS: dict[str, DataSet] = {"lhdl-hip": LHDL_HIP}


def data_set(name: str) -> DataSet:
    """Return a data set by its name.

    Raises
    ------
    InputError
        If there is none of that name.
    """
    if name not in DATA_SETS:
        raise InputError("", f"there is no data set {name!r}; {suggestion(name, DATA_SETS)}")
    return DATA_SETS[name]


#: Where raw files of public repositories are.
HOST = "https://raw.githubusercontent.com"
#: For a connection, and for each part of an answer [s].
PATIENCE = 30.0
#: Read at a time, and of a file at most, far more than any of them has [bytes].
CHUNK, MOST = 1 << 20, 1 << 28


def fetch(
    name: str,
    folder: str | PathLike[str] | None = None,
    *,
    accept_licence: bool = False,
    host: str = HOST,
    announce: Callable[[str], None] = lambda words: None,
) -> Path:
    """Download a public data set and write it as a scene.

    Files come from pinned commits of the repositories where they are published. They are checked by
    SHA-256; those whose checksum is not known by what they hold (triangles, volume, bounds, landmarks). Where
    anything fails, nothing is left behind.

    Parameters
    ----------
    name : str
        ``"lhdl-hip"``, or another one of :data:`vtkmuscle.fetch.DATA_SETS`.
    folder : path, optional
        Where the scene goes: a folder that does not exist yet. By default ``name`` in the working folder.
    accept_licence : bool, optional
        Whether you accept ``vtkmuscle.fetch.DATA_SETS[name].licence``.
    host : str, optional
        A mirror, which serves ``OWNER/REPOSITORY/COMMIT/PATH``.
    announce : callable, optional
        Is told what is downloaded.

    Returns
    -------
    Path
        The scene.toml. Beside it are ``LICENCE.txt`` and ``sources.json``: where each file comes from, with
        its SHA-256.

    Raises
    ------
    InputError
        If the licence is not accepted, the folder is in the way, a file cannot be downloaded or is not the
        one that it should be.

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
    for stale in left_behind(target.parent):
        if stale.name.startswith(f".{target.name}.") and stale.is_dir():
            shutil.rmtree(stale)
    staging = beside(target)
    try:
        (staging / "source").mkdir(parents=True)
        files = {}
        for number, file in enumerate(data.files, start=1):
            announce(f"{number} of {len(data.files)}: {file.url(host)}")
            files[file.name] = _download(file, staging / "source", host)
        announce("putting the scene together")
        scene = data.build(files, staging).relative_to(staging)
        Scene.load(staging / scene)
        write_text(staging / "LICENCE.txt", data.licence)
        write_text(staging / "sources.json", json.dumps(_sources(data.files, files, host), indent=1) + "\n")
        shutil.rmtree(staging / "source")
        staging.rename(target)
    finally:
        shutil.rmtree(staging, ignore_errors=True)
    return target / scene


def _download(file: RemoteFile, folder: Path, host: str) -> Path:
    url = file.url(host)
    path = folder / file.name
    headers = {"Accept-Encoding": "identity"}
    try:
        with requests.get(url, stream=True, timeout=PATIENCE, headers=headers) as response:
            response.raise_for_status()
            with path.open("wb") as out:
                for part in response.iter_content(CHUNK):
                    if out.tell() + len(part) > MOST:
                        raise InputError(url, f"the server sends more than {MOST >> 20} MB", AGAIN)
                    out.write(part)
    except requests.exceptions.HTTPError as error:
        raise InputError(url, f"the server does not give it: {error}", AGAIN) from error
    except (
        requests.exceptions.ConnectionError,
        requests.exceptions.ChunkedEncodingError,
        requests.exceptions.Timeout,
    ) as error:
        problem = "there is no connection, or it was cut"
        raise InputError(url, problem, "check the network, then try again") from error
    except requests.exceptions.RequestException as error:
        raise InputError(url, f"the download failed: {error}", "check the address") from error
    if file.sha256 and (has := file_digest(path)) != file.sha256:
        raise InputError(url, f"its SHA-256 is {has}, but must be {file.sha256}", AGAIN)
    return path


def _sources(
    listed: tuple[RemoteFile, ...], files: Mapping[str, Path], host: str
) -> list[dict[str, str | bool]]:
    """Return where each file comes from, and its checksum."""
    return [
        {
            "url": one.url(host),
            "sha256": file_digest(files[one.name]),
            "known": bool(one.sha256),
        }
        for one in listed
    ]
