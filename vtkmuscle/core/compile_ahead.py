"""Kernels compiled by a process of their own, from the last one that a run needs to the first.

Numba compiles one kernel at a time, under one lock per process. So at the first run on a machine a second
process begins at the other end of the list of kernels; each process finds what the other has compiled, in
the folder where kernels are kept, and they meet in the middle.
"""

from __future__ import annotations

import atexit
import gc
import hashlib
import importlib
import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from functools import cache
from pathlib import Path
from typing import IO, Any

import numba
from numba.core.registry import cpu_target

from vtkmuscle.core.kernel_cache import kernel_folder
from vtkmuscle.isolation import isolated_python

#: The kernels that a run needs, in this order: module, name and types of arguments;
#: ``benchmarks/compile_times.py --write`` makes it.
LIST = Path(__file__).with_name("kernels.json")

Spelled = str | list[Any]

types: Any = numba.types


def compile_ahead() -> None:
    """Let a second process compile kernels, unless all are there; it ends with this one at the latest."""
    folder = kernel_folder()
    if folder is None or numba.config.DISABLE_JIT or _mark(folder).is_file():
        return
    _second_process()


@cache
def _second_process() -> None:
    # The package may be where no other code is loaded from: the folder that somebody works in.
    root = str(Path(__file__).parents[2])
    code = f"sys.path.append({root!r})\nfrom {__name__} import _work\n_work()"
    # It sees that this process ends, however it does, by the end of its input.
    process = subprocess.Popen(
        isolated_python(code),
        env={**os.environ, "NUMBA_CACHE_DIR": numba.config.CACHE_DIR},
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    atexit.register(_end, process)


def _end(process: subprocess.Popen[bytes]) -> None:
    assert process.stdin is not None
    process.stdin.close()
    process.wait()


def _work() -> None:
    """Do what the second process is there for, where no other one does."""
    folder = kernel_folder()
    assert folder is not None
    folder.mkdir(parents=True, exist_ok=True)
    threading.Thread(target=_end_with_input, args=(sys.stdin,), daemon=True).start()
    with ExitStack() as stack:
        if os.name == "posix":
            import fcntl  # noqa: PLC0415 -- Windows has none

            file = stack.enter_context(open(folder / ".ahead", "ab"))
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                return
        gc.disable()  # a third more memory for half a minute, a twentieth of the time
        for module, name, arguments in reversed(json.loads(LIST.read_text(encoding="utf-8"))):
            kernel = getattr(importlib.import_module(module), name)
            kernel.compile(tuple(map(type_of, arguments)))
        _mark(folder).touch()


def _end_with_input(source: IO[str]) -> None:
    with suppress(OSError):
        source.read()
    os._exit(0)


def _mark(folder: Path) -> Path:
    """Return the file that says that all kernels of this version, for this processor, are in a folder."""
    root = Path(__file__).parent
    key = hashlib.sha256(
        f"{numba.__version__} {sys.version} {cpu_target.target_context.codegen().magic_tuple()}".encode()
    )
    for file in sorted([*root.rglob("*.py"), LIST]):
        key.update(hashlib.sha256(file.read_bytes()).digest())
    return folder / f".compiled-{key.hexdigest()[:16]}"


def spelled(kind: Any) -> Spelled:
    """Return a type of numba as JSON has it.

    Examples
    --------
    >>> from numba import float64
    >>> from vtkmuscle.core.compile_ahead import spelled, type_of
    >>> spelled(float64[:, ::1])
    ['array', 'float64', 2, 'C', False]
    >>> type_of(spelled(float64[:, ::1])) == float64[:, ::1]
    True
    """
    if isinstance(kind, types.Array):
        return ["array", str(kind.dtype), kind.ndim, kind.layout, not kind.mutable]
    if isinstance(kind, types.NamedTuple | types.NamedUniTuple):
        cls = kind.instance_class
        return ["named", cls.__module__, cls.__name__, *map(spelled, kind)]
    if isinstance(kind, types.BaseTuple):
        return ["tuple", *map(spelled, kind)]
    return str(kind)


def type_of(text: Spelled) -> Any:
    """Return the type of numba that :func:`spelled` has spelled."""
    if isinstance(text, str):
        return getattr(types, {"bool": "boolean"}.get(text, text))
    sort, *parts = text
    if sort == "array":
        dtype, dimensions, layout, readonly = parts
        return types.Array(type_of(dtype), dimensions, layout, readonly=readonly)
    if sort == "named":
        module, name, *fields = parts
        return types.BaseTuple.from_types(_types(fields), getattr(importlib.import_module(module), name))
    return types.BaseTuple.from_types(_types(parts))


def _types(texts: Iterable[Spelled]) -> tuple[Any, ...]:
    return tuple(map(type_of, texts))
