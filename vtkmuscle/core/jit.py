"""Compilation of kernels by numba, with a disk cache.

Kernels are compiled by numba's ``njit`` and release the GIL, so Python threads run kernels side by side: no
numba threading layer is used (numba's ``workqueue`` layer aborts the process on concurrent parallel calls).
Division by zero follows IEEE 754, as in numpy, without an exception.

Numba's cache looks at the file of a function alone, but constants and inlined functions of further files
become part of the machine code. So kernels are kept in a folder named after the content of the kernels' file
and of all directly or indirectly imported files of the package. Equal copies share the folder.

A file per signature: several processes may write at once. Damaged files are compiled anew.
"""

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
from pathlib import Path
from typing import Any, TypeVar

import numba
import numba.core.options

from vtkmuscle.core.machine import FOLDER_VARIABLE, cache_folder

F = TypeVar("F", bound=Callable[..., object])

#: Numbers that kernels compute side by side: two vectors of eight, or four of four.
LANES = 16

#: Versions of a file's kernels on disk, last used, by any copy of the package.
VERSIONS = 8

#: Imports of a file; names in brackets may be modules.
_IMPORT = re.compile(r"^[ \t]*(?:from|import)[ \t]+([\w.]+)(?:[ \t]+import[ \t]+(\([^)]*\)|[^\n]*))?", re.M)


#: Option without reference counting, empty if unknown to numba.
UNCOUNTED = {"_nrt": False} if hasattr(numba.core.options.DefaultOptions, "_nrt") else {}


def kernel(function: F) -> F:
    """Compile a function of arrays and numbers.

    The function makes no arrays. The machine code is kept on disk. References to views such as ``points[i]``
    are not counted, if numba can leave out the counting: an atomic operation that triples the time to look
    up distances.
    """
    return _compiled(function, **UNCOUNTED)


def array_kernel(function: F) -> F:
    """Compile a function that makes arrays. As :func:`kernel`. The function's inner loops are kernels."""
    return _compiled(function)


def reduction(function: F) -> F:
    """Compile as :func:`kernel`, with sums in several parts."""
    return _compiled(function, fastmath={"contract", "reassoc"}, **UNCOUNTED)


def vector_kernel(function: F) -> F:
    """Compile as :func:`kernel`, with fused multiply-adds. Multiplications and additions may be fused."""
    return _compiled(function, fastmath={"contract"}, **UNCOUNTED)


def lane(function: F) -> F:
    """Compile a SIMD lane's work, inlined into the calling loop."""
    return _compiled(function, fastmath={"contract"}, forceinline=True, nogil=False, **UNCOUNTED)


def _compiled(function: F, **options: Any) -> F:
    # Numba takes options that are not given from the first kernel that calls a function.
    defaults = {"nogil": True, "error_model": "numpy", "fastmath": False, "forceinline": False}
    compiled: Any = numba.njit(**{**defaults, **options})(function)
    _keep(compiled)
    result: F = compiled
    return result


def kernel_folder() -> Path | None:
    """Return the folder of compiled kernels, or None.

    None without a cache. Numba's ``NUMBA_CACHE_DIR`` if set, else ``kernels`` in the
    :func:`~vtkmuscle.core.machine.cache_folder`.
    """
    if numba.config.CACHE_DIR:
        return Path(numba.config.CACHE_DIR)
    folder = cache_folder()
    return None if folder is None else folder / "kernels"


def _keep(compiled: Any) -> None:
    """Let numba keep the machine code of a module's function."""
    function, folder = getattr(compiled, "py_func", None), kernel_folder()
    if function is None or folder is None or "<locals>" in function.__qualname__:
        return
    file = Path(function.__code__.co_filename)
    if file.is_file():
        compiled._cache = KernelCache(function, file, folder)  # as Dispatcher.enable_caching does


_unusable: set[Path] = set()


def _warn_of(folder: Path, error: Exception) -> None:
    """Warn of an unusable cache of compiled kernels. Once per folder."""
    if folder not in _unusable:
        _unusable.add(folder)
        words = f"compiled kernels cannot be kept in {folder} with numba {numba.__version__} "
        words += f"({getattr(error, 'strerror', None) or error}), and are compiled in each run, for minutes; "
        warnings.warn(f"{words}set {FOLDER_VARIABLE} to a writable folder, or to nothing", stacklevel=4)


class KernelCache:
    """Cache of a kernel's machine code for numba, with a file per signature."""

    def __init__(self, function: Callable[..., object], file: Path, folder: Path) -> None:
        self._module = function.__module__
        self._name = f"{function.__qualname__}-{function.__code__.co_firstlineno}"
        self._folder = folder / f"{self._module}-{source_key(self._module, file)}"
        with suppress(OSError):  # missing or read-only
            os.utime(self._folder)

    @property
    def cache_path(self) -> str:
        """Folder of the present version of the kernel's module."""
        return str(self._folder)

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return a signature's machine code, None without a usable file."""
        target.refresh()
        try:
            content = pickle.loads(self._file(signature, target.codegen()).read_bytes())
            return numba.core.compiler.CompileResult._rebuild(target, *content)
        except AttributeError as error:
            _warn_of(self._folder.parent, error)
        except (OSError, EOFError, pickle.UnpicklingError):  # missing, unreadable, or cut short
            pass
        return None

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep the machine code of a signature; an unwritable file gives a warning."""
        if compiled.library.has_dynamic_globals:  # addresses of this process
            return
        part = self._folder / f"{uuid.uuid4().hex}.part"
        try:
            content = numba.core.serialize.dumps(compiled._reduce())
            path = self._file(signature, compiled.library.codegen)
            self._make_folder()
            part.write_bytes(content)
            os.replace(part, path)
        except (OSError, AttributeError) as error:  # an unusable folder, or a numba of other parts
            with suppress(OSError):
                part.unlink()
            _warn_of(self._folder.parent, error)

    def flush(self) -> None:
        """Do nothing; kernel files stay valid for the sources."""

    def _file(self, signature: Any, codegen: Any) -> Path:
        made_for = signature, codegen.magic_tuple(), numba.__version__, sys.implementation.cache_tag
        digest = hashlib.sha256(repr(made_for).encode()).hexdigest()[:16]
        return self._folder / f"{self._name}-{digest}.kernel"

    def _make_folder(self) -> None:
        """Make the folder, and remove the module's versions unused for longest."""
        if self._folder.is_dir():
            return
        self._folder.mkdir(parents=True, exist_ok=True)
        versions = []
        for path in self._folder.parent.glob(f"{self._module}-*"):
            with suppress(OSError):  # another process has removed it
                versions.append((path.stat().st_mtime, path))
        for _, path in sorted(versions)[:-VERSIONS]:
            shutil.rmtree(path, ignore_errors=True)


def source_key(module: str, file: Path) -> str:
    """Return a key of a module's source and imports.

    Imports within the package count, directly or not. 16 hexadecimal digits, equal for copies of the package.
    """
    names = module.split(".")
    root = file.absolute().parents[len(names) - (file.stem != "__init__")]
    digests: dict[str, bytes] = {}
    waiting = {module: file}
    while waiting:
        name, source = waiting.popitem()
        stat = source.stat()
        digests[name], imported = _contents(source, stat.st_mtime_ns, stat.st_size, root, names[0])
        waiting.update((name, source) for name, source in imported if name not in digests)
    content = b"".join(f"{name} ".encode() + digest for name, digest in sorted(digests.items()))
    return hashlib.sha256(content).hexdigest()[:16]


@cache
def _contents(
    file: Path, _changed: int, _size: int, root: Path, package: str
) -> tuple[bytes, list[tuple[str, Path]]]:
    """Return a file's digest, and the imported modules."""
    content = file.read_bytes()
    names = []
    for module, members in _IMPORT.findall(content.decode("utf-8")):
        if module.split(".")[0] == package:
            names += [module, *(f"{module}.{member}" for member in re.findall(r"\w+", members))]
    sources = ((name, _source(root, name)) for name in names)
    return hashlib.sha256(content).digest(), [(name, file) for name, file in sources if file is not None]


def _source(root: Path, name: str) -> Path | None:
    """Return a module's source in a folder, or None."""
    path = root.joinpath(*name.split("."))
    return next((file for file in (path.with_suffix(".py"), path / "__init__.py") if file.is_file()), None)
