"""How kernels are compiled, by numba's ``njit``, and kept on disk until anything that they depend on changes.

Kernels release the GIL, so that Python threads run them side by side: no numba threading layer is used
(its ``workqueue`` layer aborts the process on concurrent parallel calls). Division by zero follows IEEE 754,
as in numpy, rather than raising.

Numba's own cache looks at the file of a function alone. But constants and inlined functions of other files
become part of the machine code too. So kernels are kept in a folder named after the content of their file
and of all files of the package that it imports, directly or not. Equal copies of the package share it.

The cached files are executed. So each begins with a checksum, a damaged one is removed and made anew, and
none is read that another user could have written.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import re
import shutil
import sys
import uuid
import warnings
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from operator import attrgetter
from pathlib import Path
from typing import Any, TypeVar

import numba
import numba.core.options

from vtkmuscle.core.machine import cache_folder, check_nobody_else_writes, warn_of_folder

F = TypeVar("F", bound=Callable[..., object])

#: Versions of a file's kernels that are kept: those used last, by any copy of the package.
VERSIONS = 8

#: Undocumented parts of numba that the cache needs; where one is missing, nothing is kept.
_OF_NUMBA = (
    "core.codegen.CPUCodegen.magic_tuple",
    "core.compiler.CompileResult._rebuild",
    "core.compiler.CompileResult._reduce",
    "core.dispatcher.Dispatcher.enable_caching",
    "core.serialize.dumps",
)

#: What a file imports; names in brackets may be modules.
_IMPORT = re.compile(r"^[ \t]*(?:from|import)[ \t]+([\w.]+)(?:[ \t]+import[ \t]+(\([^)]*\)|[^\n]*))?", re.M)


def uncounted() -> dict[str, bool]:
    """Return the option that leaves out the counting of references, none where numba does not know it."""
    return {"_nrt": False} if hasattr(numba.core.options.DefaultOptions, "_nrt") else {}


#: See :func:`uncounted`.
UNCOUNTED = uncounted()


def kernel(function: F) -> F:
    """Compile a function of plain arrays and numbers that makes no arrays, and keep the machine code on disk.

    Views of the arrays, such as ``points[i]``, are not counted as references, where numba can leave that out.
    Counting is an atomic operation: looking up distances takes three times as long with it.
    """
    return _compiled(function, **UNCOUNTED)


def array_kernel(function: F) -> F:
    """Compile as :func:`kernel` does a function that makes arrays; its inner loops are kernels."""
    return _compiled(function)


def reduction(function: F) -> F:
    """Compile as :func:`kernel` does; sums may be taken in several parts at a time."""
    return _compiled(function, fastmath={"contract", "reassoc"}, **UNCOUNTED)


def vector_kernel(function: F) -> F:
    """Compile as :func:`kernel` does, with multiplications and additions fused."""
    return _compiled(function, fastmath={"contract"}, **UNCOUNTED)


def lane(function: F) -> F:
    """Compile the work of one SIMD lane, which is inlined into the loop that calls it."""
    return _compiled(function, fastmath={"contract"}, forceinline=True, nogil=False, **UNCOUNTED)


def _compiled(function: F, **options: Any) -> F:
    # What is not said here numba takes from the kernel that happens to call a function first.
    said = {"nogil": True, "error_model": "numpy", "fastmath": False, "forceinline": False}
    compiled: Any = numba.njit(**{**said, **options})(function)
    _keep(compiled)
    result: F = compiled
    return result


def kernel_folder() -> Path | None:
    """Return the folder of all compiled kernels, None where they are not to be kept.

    That is numba's ``NUMBA_CACHE_DIR`` where it is set, else ``kernels`` in the
    :func:`~vtkmuscle.core.machine.cache_folder`.
    """
    if numba.config.CACHE_DIR:
        return Path(numba.config.CACHE_DIR)
    folder = cache_folder()
    return None if folder is None else folder / "kernels"


def _keep(compiled: Any) -> None:
    """Let numba keep the machine code of a function, if it is not within a function and stands in a file."""
    function, folder = getattr(compiled, "py_func", None), kernel_folder()
    if function is None or folder is None or "<locals>" in function.__qualname__:
        return
    file = Path(function.__code__.co_filename)
    if file.is_file() and _numba_is_known():
        compiled._cache = KernelCache(function, file, folder)  # as Dispatcher.enable_caching does


@cache
def _numba_is_known() -> bool:
    """Return whether numba has all of _OF_NUMBA; warn once if not."""
    try:
        for name in _OF_NUMBA:
            attrgetter(name)(numba)
    except AttributeError as error:
        warnings.warn(
            f"compiled kernels cannot be kept with numba {numba.__version__} ({error}), so they are compiled "
            "anew each time, which takes minutes; install an older one",
            stacklevel=4,
        )
        return False
    return True


class KernelCache:
    """The cache of a kernel's machine code that numba reads and writes: one file per signature.

    ``grows`` in a process that has compiled a kernel to be kept: not all that it needs were there.
    """

    grows = False

    def __init__(self, function: Callable[..., object], file: Path, folder: Path) -> None:
        self._module = function.__module__
        self._name = f"{function.__qualname__}-{function.__code__.co_firstlineno}"
        self._folder = folder / f"{self._module}-{source_key(self._module, file)}"
        with suppress(OSError):  # not there yet, or only to be read
            os.utime(self._folder)

    @property
    def cache_path(self) -> str:
        """The folder for this version of the kernel's module."""
        return str(self._folder)

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return the machine code kept for a signature, None where no usable file exists."""
        target.refresh()
        body = self._read(self._file(signature, target.codegen()))
        if body is None:
            return None
        return numba.core.compiler.CompileResult._rebuild(target, *pickle.loads(body))

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep the machine code of a signature; warn where its file cannot be written."""
        if compiled.library.has_dynamic_globals:  # addresses of this process
            return
        KernelCache.grows = True
        body = numba.core.serialize.dumps(compiled._reduce())
        try:
            self._write(self._file(signature, compiled.library.codegen), body)
        except OSError as error:
            warn_of_folder(self._folder.parent, error)

    def flush(self) -> None:
        """Do nothing: a kernel's file stays for as long as its sources do."""

    def _file(self, signature: Any, codegen: Any) -> Path:
        made_for = signature, codegen.magic_tuple(), numba.__version__, sys.implementation.cache_tag
        digest = hashlib.sha256(repr(made_for).encode()).hexdigest()[:16]
        return self._folder / f"{self._name}-{digest}.kernel"

    def _check_folders(self) -> None:
        for folder in (self._folder.parent, self._folder):
            check_nobody_else_writes(folder.stat())

    def _read(self, path: Path) -> bytes | None:
        """Return the content of a file after its checksum, None where they differ or the file is unsafe."""
        try:
            self._check_folders()
            with open(path, "rb") as file:
                check_nobody_else_writes(os.fstat(file.fileno()))
                content = file.read()
        except OSError:
            return None
        body = content[hashlib.sha256().digest_size :]
        if content == _checksum(path, body) + body:
            return body
        with suppress(OSError):  # a folder that can only be read
            path.unlink()
        return None

    def _write(self, path: Path, body: bytes) -> None:
        """Write a file under another name and rename it, so that several processes may do so at once."""
        self._make_folder()
        self._check_folders()
        part = path.with_suffix(f".{uuid.uuid4().hex}.part")
        try:
            with open(part, "xb", opener=_only_ours) as file:
                file.write(_checksum(path, body) + body)
            os.replace(part, path)
        except OSError:
            part.unlink(missing_ok=True)
            raise

    def _make_folder(self) -> None:
        """Make the folder, and remove those of the module's versions that were used longest ago."""
        if self._folder.is_dir():
            return
        self._folder.parent.mkdir(0o755, parents=True, exist_ok=True)
        self._folder.mkdir(0o755, exist_ok=True)
        versions = []
        for path in self._folder.parent.glob(f"{self._module}-*"):
            with suppress(OSError):  # another process has removed it
                versions.append((path.stat().st_mtime, path))
        for _, path in sorted(versions)[:-VERSIONS]:
            shutil.rmtree(path, ignore_errors=True)


def _checksum(path: Path, body: bytes) -> bytes:
    """Return the checksum of a file's content and of its name, so that no file can stand for another."""
    return hashlib.sha256(f"{path.parent.name}/{path.name} ".encode() + body).digest()


def _only_ours(path: str, flags: int) -> int:
    """Open a file that only this user can write to, whatever the umask."""
    return os.open(path, flags, 0o644)


def source_key(module: str, file: Path) -> str:
    """Return a key of the content of a module's file, and of all that it imports from its package.

    That is 16 hexadecimal digits, the same for copies of the package in different places.
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
    """Return a file with its time and size, by which a later change is noticed."""
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
