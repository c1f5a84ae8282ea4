"""What compiling the kernels of a scene takes: ``python benchmarks/compile_times.py [SCENE]``.

Runs two frames of a scene (default: the phantom hip of ``vtkmuscle demo``) with nothing cached, and prints
the seconds of processor time kernel by kernel; those of numba's own functions are with the kernel that needed
them first. A kernel that is compiled more than once is called with arguments of several types or layouts, or
with several constants by other kernels.
"""

from __future__ import annotations

import argparse
import os
import time
from collections import Counter
from typing import Any

import numba
from numba.core import event


class Compilations(event.Listener):
    """Listens to numba while it compiles: how often, and how long, by kernel."""

    def __init__(self) -> None:
        self.times: Counter[str] = Counter()
        self.seconds: Counter[str] = Counter()
        self._open: list[str] = []
        self._since = 0.0

    def on_start(self, event: Any) -> None:
        """Begin with a function; the clock of the one around it stops."""
        self._take_time()
        function = event.data["dispatcher"].py_func
        name = f"{function.__module__.removeprefix('vtkmuscle.core.')}.{function.__name__}"
        self._open.append(name if function.__module__.startswith("vtkmuscle.") else self._open[-1])

    def on_end(self, _: Any) -> None:
        """End with it; the clock of the one around it goes on."""
        self._take_time()
        self.times[self._open.pop()] += 1

    def _take_time(self) -> None:
        now = time.thread_time()
        if self._open:
            self.seconds[self._open[-1]] += now - self._since
        self._since = now


def compilations(scene: str | None) -> Compilations:
    """Return what is compiled for two frames of a scene; one worker, so that it is always the same."""
    from vtkmuscle import Scene, phantoms

    listener = Compilations()
    with event.install_listener("numba:compile", listener):
        loaded = Scene.from_phantom(phantoms.hip()) if scene is None else Scene.load(scene)
        loaded.run(None, frames="0:2", figures=False, workers=1)
    return listener


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", help="a scene.toml; default the phantom hip")
    parser.add_argument("--most", type=int, default=40, help="kernels to print, longest first")
    asked = parser.parse_args()
    numba.config.CACHE_DIR = os.environ["VTKMUSCLE_CACHE"] = ""
    done = compilations(asked.scene)
    print(f"{'kernel':60s} compiled  seconds")
    for name, seconds in done.seconds.most_common(asked.most):
        print(f"{name:60s} {done.times[name]:8d} {seconds:8.2f}")
    print(f"{f'all {len(done.times)}':60s} {done.times.total():8d} {sum(done.seconds.values()):8.2f}")


if __name__ == "__main__":
    main()
