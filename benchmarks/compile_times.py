"""What compiling the kernels of a scene takes: ``python benchmarks/compile_times.py [SCENE]``.

Runs two frames of a scene (default: the phantom hip of ``vtkmuscle demo``) with nothing cached, and prints
the seconds of processor time and the instructions that numba writes for LLVM, kernel by kernel; those of
numba's own functions are with the kernel that needed them first. The instructions depend neither on the
machine nor on what else it does: ``guard.py`` keeps their sum.

``--write`` writes the list of the demo's kernels by which a second process compiles at the first run.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from dataclasses import dataclass
from typing import Any

os.environ["VTKMUSCLE_CACHE"] = ""
os.environ.pop("NUMBA_CACHE_DIR", None)

from numba.core import codegen, event

from vtkmuscle.core.compile_ahead import LIST, spelled

#: The parts of the table that are printed without --all.
MOST = 40


@dataclass
class Compiled:
    """What one compilation took, without those that it was the reason for."""

    kernel: str
    arguments: str
    of_python: tuple[str, str, list[Any]] | None
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
        arguments, called = event.data["args"], None
        if not self._open:
            called = function.__module__, function.__name__, list(map(spelled, arguments))
        self._open.append((Compiled(name, str(arguments), called), now))

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
    from vtkmuscle import Scene, phantoms

    with Compilations() as listener:
        loaded = Scene.from_phantom(phantoms.hip()) if scene is None else Scene.load(scene)
        loaded.run(None, frames="0:2", figures=False, workers=1)
    return listener.done


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
    asked = parser.parse_args()
    done = compilations(asked.scene)
    print(table(done, None if asked.all else MOST))
    if asked.write:
        rows = [json.dumps(one.of_python) for one in done if one.of_python is not None]
        LIST.write_text("[\n" + ",\n".join(rows) + "\n]\n", encoding="utf-8")
    if asked.twice:
        names = [one.kernel for one in done]
        for one in done:
            if names.count(one.kernel) > 1:
                print(f"{one.kernel}({one.arguments}): {one.seconds:.2f} s")


if __name__ == "__main__":
    main()
