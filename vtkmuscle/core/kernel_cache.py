"""Compiled kernels kept on disk, for as long as nothing that they are made from changes.

Numba looks at the file of a function alone. But a constant or an inlined function of another file becomes
part of the machine code too. So kernels are kept in a folder that is named after the content of their file
and of all files of the package that it imports, directly or not: with any change they are compiled anew,
and copies of the package that are the same, wherever they lie, share what is compiled.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache

from vtkmuscle.core.cache_folder import cache_folder, warn_of_folder

#: So many versions of a file's kernels are kept, those used last: of several copies of the package.
VERSIONS = 8

#: What a file imports; names in brackets may be modules.
_IMPORT = re.compile(r"^[ \t]*(?:from|import)[ \t]+([\w.]+)(?:[ \t]+import[ \t]+(\([^)]*\)|[^\n]*))?", re.M)


def kernel_folder() -> Path | None:
    """Return the folder of all compiled kernels, None where they are not to be kept.

    That is numba's ``NUMBA_CACHE_DIR`` where it is set, else ``kernels`` in the
    :func:`~vtkmuscle.core.cache_folder.cache_folder`.
    """
    if numba.config.CACHE_DIR:
        return Path(numba.config.CACHE_DIR)
    folder = cache_folder()
    return None if folder is None else folder / "kernels"


def kernel_cache(function: Callable[..., object]) -> Any:
    """Return where numba is to keep what it compiles of a function.

    Parameters
    ----------
    function : callable
        A kernel of a module in a file.

    Returns
    -------
    numba.core.caching.FunctionCache or None
        None where nothing is to be kept, or the module has no source file.
    """
    folder, file = kernel_folder(), Path(function.__code__.co_filename)
    if folder is None or not file.is_file():
        return None
    return KernelCache(function)


class Locator:
    """Tells numba where the machine code of a function is kept, and what it is made from.

    Parameters
    ----------
    function : callable
        The kernel.
    file : str
        Where it is defined.
    """

    def __init__(self, function: Callable[..., object], file: str) -> None:
        parent = kernel_folder()
        assert parent is not None
        self._line = function.__code__.co_firstlineno
        self._module = function.__module__
        self._py_file = file  # for numba's warnings
        self._key = source_key(self._module, Path(file))
        self._folder = parent / f"{self._module}-{self._key}"
        with suppress(OSError):  # not there yet, or only to be read
            os.utime(self._folder)

    @classmethod
    def from_function(cls, function: Callable[..., object], file: str) -> Locator:
        """Return the locator of a function."""
        return cls(function, file)

    def get_cache_path(self) -> str:
        """Return the folder for this version of the function's module."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return the key of the sources."""
        return self._key

    def get_disambiguator(self) -> str:
        """Return what tells functions of the same name apart."""
        return str(self._line)

    def ensure_cache_path(self) -> None:
        """Make the folder, and remove those of the module's versions that were used longest ago."""
        if self._folder.is_dir():
            return
        self._folder.mkdir(parents=True, exist_ok=True)
        versions = []
        for path in self._folder.parent.glob(f"{self._module}-*"):
            with suppress(OSError):  # another process has removed it
                versions.append((path.stat().st_mtime, path))
        for _, path in sorted(versions)[:-VERSIONS]:
            shutil.rmtree(path, ignore_errors=True)


class _Placed(FunctionCache._impl_class):
    """What numba keeps of a compiled function, at the place that the locator says."""

    _locator_classes = (Locator,)


class KernelCache(FunctionCache):
    """Numba's cache of a function; processes that compile it at once do not get in each other's way.

    The two files that numba writes are one whole under a lock: otherwise of two processes that compile a
    function for other arguments one could find the other's machine code under its own name.
    """

    _impl_class = _Placed

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return what is kept for a signature, None where there is nothing that can be read."""
        try:
            return super().load_overload(signature, target)
        except OSError:
            return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled for a signature; warn where that is not possible."""
        try:
            self._impl.locator.ensure_cache_path()
            with _locked(Path(self.cache_path)):
                super().save_overload(signature, compiled)
        except OSError as error:
            warn_of_folder(
                Path(self.cache_path).parent,
                error,
                "compiled kernels",
                "compiled anew each time, which takes minutes",
            )


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Wait for the lock of a folder; the system lets go of it where the process is killed."""
    if os.name != "posix":
        yield
        return
    import fcntl  # noqa: PLC0415 -- Windows has none

    with open(folder / ".lock", "ab") as file:
        with suppress(OSError):  # a file system without locks
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def source_key(module: str, file: Path) -> str:
    """Return a key of the content of a module's file, and of all that it imports from its package.

    Parameters
    ----------
    module : str
        Its full name, as ``vtkmuscle.core.taut.paths``.
    file : Path
        Its source.

    Returns
    -------
    str
        16 hexadecimal digits; the same for copies of the package in different places.
    """
    names = module.split(".")
    root = file.absolute().parent
    for _ in names if file.stem == "__init__" else names[1:]:
        root = root.parent
    files, waiting = {module: file}, [file]
    while waiting:
        for name, source in _imported(*_version(waiting.pop()), root, names[0]):
            if name not in files:
                files[name] = source
                waiting.append(source)
    digest = hashlib.sha256()
    for name, source in sorted(files.items()):
        digest.update(f"{name} ".encode() + _hash(*_version(source)))
    return digest.hexdigest()[:16]


def _version(file: Path) -> tuple[Path, int, int]:
    """Return a file, and by what a change of it while the process runs is noticed."""
    stat = file.stat()
    return file, stat.st_mtime_ns, stat.st_size


@cache
def _imported(file: Path, _changed: int, _size: int, root: Path, package: str) -> list[tuple[str, Path]]:
    """Return the modules of a package in a folder that a file imports, and their sources."""
    found = []
    for module, names in _IMPORT.findall(file.read_text(encoding="utf-8")):
        if module.split(".")[0] == package:
            found += [module, *(f"{module}.{name}" for name in re.findall(r"\w+", names))]
    sources = ((name, _source(root, name)) for name in found)
    return [(name, source) for name, source in sources if source is not None]


def _source(root: Path, name: str) -> Path | None:
    """Return the source of a module in a folder, None where there is none of this name."""
    place = root.joinpath(*name.split("."))
    candidates = (place.with_suffix(".py"), place / "__init__.py")
    return next((file for file in candidates if file.is_file()), None)


@cache
def _hash(file: Path, _changed: int, _size: int) -> bytes:
    return hashlib.sha256(file.read_bytes()).digest()
