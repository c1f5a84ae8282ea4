"""What compiling the kernels of a scene takes: ``python benchmarks/compile_times.py [SCENE]``.

Runs two frames of a scene (default: the phantom hip of ``vtkmuscle demo``) with nothing cached, and prints
the seconds of processor time and the instructions that numba writes for LLVM, kernel by kernel; those of
numba's own functions are with the kernel that needed them first. The instructions depend neither on the
machine nor on what else it does: ``guard.py`` keeps their sum.

``--write`` writes the list of the demo's kernels by which a second process compiles at the first run.
``--count`` prints the instructions of the kernels in that list, which takes a third of the time: nothing is
compiled to the end. ``--check`` tells kernels that the demo calls and are not in the list, and those that
are and need not be, exit status 1.
"""

from __future__ import annotations

import argparse
import importlib
import json
import os
import time
from dataclasses import dataclass
from typing import Any

from numba.core import codegen, config, dispatcher, event

from vtkmuscle.core.compile_ahead import LIST, spelled, type_of
from vtkmuscle.core.kernel_cache import kernel_folder

#: The parts of the table that are printed without --all.
MOST = 40


@dataclass
class Compiled:
    """What one compilation took, without those that it was the reason for."""

    kernel: str
    arguments: str
    seconds: float = 0.0
    instructions: int = 0


class Compilations(event.Listener):
    """Listens to numba while it compiles."""

    def __init__(self) -> None:
        self.done: list[Compiled] = []
        self._open: list[tuple[Compiled, float]] = []
        self._add = codegen.CPUCodeLibrary.add_ir_module

    def __enter__(self) -> Compilations:
        listener, add = self, self._add

        def counted(library: Any, module: Any) -> None:
            listener.count(sum(len(block.instructions) for f in module.functions for block in f.blocks))
            add(library, module)

        codegen.CPUCodeLibrary.add_ir_module = counted
        event.register("numba:compile", self)
        return self

    def __exit__(self, *_: object) -> None:
        event.unregister("numba:compile", self)
        codegen.CPUCodeLibrary.add_ir_module = self._add

    def count(self, instructions: int) -> None:
        """Note instructions of the innermost compilation."""
        if self._open:
            self._open[-1][0].instructions += instructions

    def on_start(self, event: Any) -> None:
        """Begin with a function; the clock of the one around it stops."""
        function, now = event.data["dispatcher"].py_func, time.thread_time()
        if self._open:
            self._open[-1][0].seconds += now - self._open[-1][1]
        name = f"{function.__module__.removeprefix('vtkmuscle.core.')}.{function.__name__}"
        if not function.__module__.startswith("vtkmuscle.") and self._open:
            name = self._open[-1][0].kernel
        self._open.append((Compiled(name, str(event.data["args"])), now))

    def on_end(self, _: Any) -> None:
        """End with it; the clock of the one around it goes on."""
        compiled, since = self._open.pop()
        now = time.thread_time()
        compiled.seconds += now - since
        self.done.append(compiled)
        if self._open:
            self._open[-1] = self._open[-1][0], now


def compilations(scene: str | None) -> list[Compiled]:
    """Return what is compiled for two frames of a scene; one worker, so that it is always the same."""
    with Compilations() as listener:
        _run(scene)
    return listener.done


def _run(scene: str | None) -> None:
    from vtkmuscle import Scene, phantoms

    loaded = Scene.from_phantom(phantoms.hip()) if scene is None else Scene.load(scene)
    loaded.run(None, frames="0:2", figures=False, workers=1)


def called() -> dict[str, Any]:
    """Return the kernels that Python calls in a run of the demo, in order: a row of the list for each."""
    found: dict[str, Any] = {}
    compile_for = dispatcher.Dispatcher._compile_for_args

    def noted(self: Any, *arguments: Any, **keywords: Any) -> Any:
        types = [spelled(self.typeof_pyval(argument)) for argument in arguments]
        found.setdefault(json.dumps([self.py_func.__module__, self.py_func.__name__, types]), self)
        return compile_for(self, *arguments, **keywords)

    dispatcher.Dispatcher._compile_for_args = noted
    _run(None)
    return found


def differences() -> list[str]:
    """Return in words what a run of the demo calls beyond the list, and what is listed beyond that."""
    found = called()
    listed = {json.dumps(row): row for row in json.loads(LIST.read_text(encoding="utf-8"))}
    words = [f"called and not listed: {row}" for row in found if row not in listed]
    return words + [f"listed and not called: {text}" for text in listed if text not in found]


def instructions_of_list() -> int:
    """Return how many instructions numba writes for the kernels of the list; no machine code is made."""
    written = 0

    def count(_: Any, module: Any) -> None:
        nonlocal written
        written += sum(len(block.instructions) for f in module.functions for block in f.blocks)

    library, finalised = codegen.JITCodeLibrary, {"_finalized": True}
    library.add_ir_module = count
    library.add_linking_library = lambda *_: None
    library.finalize = lambda self: vars(self).update(finalised)
    library.get_pointer_to_function = lambda *_: 1  # never called
    codegen.JITCPUCodegen.set_env = lambda *_: None
    for module, name, arguments in json.loads(LIST.read_text(encoding="utf-8")):
        getattr(importlib.import_module(module), name).compile(tuple(map(type_of, arguments)))
    return written


def table(done: list[Compiled], most: int | None) -> str:
    """Return the kernels, those that take longest first."""
    kernels: dict[str, tuple[int, float, int]] = {}
    for one in done:
        times, seconds, instructions = kernels.get(one.kernel, (0, 0.0, 0))
        kernels[one.kernel] = times + 1, seconds + one.seconds, instructions + one.instructions
    rows = sorted(kernels.items(), key=lambda row: -row[1][1])
    lines = [f"{'kernel':50s} compiled  seconds  instructions"]
    lines += [f"{name:50s} {n:8d} {seconds:8.2f} {count:13d}" for name, (n, seconds, count) in rows[:most]]
    if len(rows) > len(lines) - 1:
        n, seconds, count = (sum(row[1][k] for row in rows[most:]) for k in range(3))
        lines.append(f"{f'{len(rows) - len(lines) + 1} others':50s} {n:8d} {seconds:8.2f} {count:13d}")
    n, seconds, count = (sum(row[1][k] for row in rows) for k in range(3))
    return "\n".join([*lines, f"{'all':50s} {n:8d} {seconds:8.2f} {count:13d}"])


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", help="a scene.toml; default the phantom hip")
    parser.add_argument("--all", action="store_true", help="all kernels")
    parser.add_argument("--twice", action="store_true", help="kernels compiled more than once, and for what")
    parser.add_argument("--write", action="store_true", help=f"write {LIST.name}, with the phantom hip only")
    parser.add_argument("--count", action="store_true", help=f"only the instructions of {LIST.name}")
    parser.add_argument("--check", action="store_true", help=f"compare {LIST.name} with what a run calls")
    asked = parser.parse_args()
    # Kernels that are compiled already do for these two; distances are computed anew for all.
    config.CACHE_DIR = str(kernel_folder() or "") if asked.write or asked.check else ""
    os.environ["VTKMUSCLE_CACHE"] = ""
    if asked.write:
        LIST.write_text("[\n" + ",\n".join(called()) + "\n]\n", encoding="utf-8")
        return
    if asked.check:
        found = differences()
        print("\n".join(found))
        raise SystemExit(bool(found))
    if asked.count:
        print(instructions_of_list())
        return
    done = compilations(asked.scene)
    print(table(done, None if asked.all else MOST))
    if asked.twice:
        names = [one.kernel for one in done]
        for one in done:
            if names.count(one.kernel) > 1:
                print(f"{one.kernel}({one.arguments}): {one.seconds:.2f} s")


if __name__ == "__main__":
    main()
