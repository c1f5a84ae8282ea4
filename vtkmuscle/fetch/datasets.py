"""A public data set: its licence, its files, and how each is downloaded and checked."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pooch

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.types import Floats

#: Longest wait for a connection and for each part of an answer [s], and further tries after a failure.
PATIENCE, RETRIES = 30.0, 2
#: What to do about a file that differs from the published one.
AGAIN = "try again; if it stays so, the published file has changed, or something on the way changes it"
#: Largest difference in number, relative, and in position [mm]: the known figures have few digits.
_NUMBER_TOLERANCE, _PLACE_TOLERANCE = 1e-3, 0.05


@dataclass(frozen=True)
class RemoteFile:
    """A file in a public repository.

    Attributes
    ----------
    name : str
        Its name while the scene is built, with the suffix of its format.
    repository : str
        ``"owner/name"``.
    commit : str
        40 digits; later versions of the file are not taken.
    path : str
        In the repository.
    sha256 : str
        64 digits, or "" where it is not known: then ``build`` checks the content.
    """

    name: str
    repository: str
    commit: str
    path: str
    sha256: str = ""

    def url(self, host: str) -> str:
        """Return the address at a host that serves raw files as GitHub does."""
        return f"{host.rstrip('/')}/{self.repository}/{self.commit}/{self.path}"

    def download(self, folder: Path, host: str) -> Path:
        """Download the file into a folder, check its SHA-256, and return its path there."""
        url = self.url(host)
        pooch.get_logger().setLevel("ERROR")  # failures are raised here
        source = pooch.create(
            folder,
            "",
            registry={self.name: f"sha256:{self.sha256}" if self.sha256 else None},
            urls={self.name: url},
            retry_if_failed=RETRIES,
        )
        # Read at once: of a stream that fails the connection would stay open.
        downloader = pooch.HTTPDownloader(timeout=PATIENCE, stream=False)
        try:
            return Path(source.fetch(self.name, downloader=downloader))
        except OSError as error:  # of requests too
            remedy = "check the network and the address, then try again"
            raise InputError(url, f"the download failed: {error}", remedy) from error
        except ValueError as error:  # the checksum
            raise InputError(url, f"this is not the published file: {error}", AGAIN) from error


@dataclass(frozen=True)
class DataSet:
    """A public data set.

    Attributes
    ----------
    title : str
        One line.
    licence : str
        The text that the user accepts: owner, permitted use, citation.
    files : tuple of RemoteFile
        Everything that is downloaded.
    build : callable
        Writes the scene into an empty folder, from the downloaded files by name, and returns the scene.toml.
        It checks the content of files without a known checksum.
    """

    title: str
    licence: str
    files: tuple[RemoteFile, ...]
    build: Callable[[Mapping[str, Path], Path], Path]


def check_figures(name: str, known: tuple[int, Floats], found: tuple[int, Floats]) -> None:
    """Raise an InputError where a number of elements, or positions (k,) [mm], are not the published ones."""
    as_many = abs(found[0] - known[0]) <= _NUMBER_TOLERANCE * known[0]
    if not (as_many and np.abs(found[1] - known[1]).max() <= _PLACE_TOLERANCE):
        has, must = (
            f"{number} elements at {np.round(place, 2).tolist()}" for number, place in (found, known)
        )
        raise InputError(name, f"this is not the published file: it has {has}, not {must}", AGAIN)
