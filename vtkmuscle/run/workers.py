"""What solves the muscles of a run side by side: this process, and others beside it.

Most of a frame is work of Python and NumPy, which hold Python's lock for 0.72 of it: any number of threads
takes at least that part of the time of one. So each worker but the first is a process.
"""

from __future__ import annotations

import warnings
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from queue import SimpleQueue
from threading import Event, Thread
from typing import Any, Self

from vtkmuscle.core.jit import KernelCache
from vtkmuscle.core.machine import is_python, processors
from vtkmuscle.core.mesh.shared import held
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.filters.base.algorithm import AbortedError
from vtkmuscle.io.child_process import Asker, ChildEndedError, ChildProcess, pickled, sendable
from vtkmuscle.run.cost import estimated_seconds, most_processes
from vtkmuscle.run.frames import Frames, MuscleTrack
from vtkmuscle.run.muscles import MuscleRun, SceneRun
from vtkmuscle.run.options import RunOptions
from vtkmuscle.run.store.writing import ResultWriter
from vtkmuscle.scene.data import Anatomy, SceneData

#: Processor time of muscles for which one more process is started: it takes about as long to begin [s].
_WORTH = 3.0
#: How often a process that waits for kernels looks whether the run was stopped [s].
_LOOK_UP = 0.2


def count_of(scene: SceneData, numbers: range, workers: int | None, *, on_disk: bool = False) -> int:
    """Return how many muscles of a scene are solved at the same time, of ``workers`` that are asked for.

    Without ``workers`` that depends on the time and the memory that the frames take, which may be kept
    ``on_disk``. Where muscles may meet, each waits for those before it, and shares their filters.
    """
    if scene.muscle_contact != "off" or not is_python():
        return 1
    if workers is None:
        worth = sum(seconds for _, seconds in estimated_seconds(scene, numbers)) / _WORTH
        workers = int(min(processors(), worth, most_processes(scene, numbers, on_disk=on_disk)))
    return max(1, min(workers, len(scene.muscles)))


class Workers:
    """The workers of a run; as a context they are waited for, and then gone.

    One is this process. The others begin as soon as they are loaded, but where this one has kernels to
    compile, which they load, only once it has passed its first frame.
    """

    def __init__(self, scene: SceneData, numbers: range, options: RunOptions, *, on_disk: bool) -> None:
        self.stopped, self.begun = Event(), Event()
        self._seconds = dict(estimated_seconds(scene, numbers))
        count = count_of(scene, numbers, options.workers, on_disk=on_disk)
        self.warned: dict[Any, Any] = {}
        self._pool = ThreadPoolExecutor(count, "muscles")
        self._free: SimpleQueue[_OtherProcess | None] = SimpleQueue()
        self._free.put(None)  # this one
        content = pickled((scene, numbers, options.clock)) if count > 1 else b""
        self._others = [_OtherProcess() for _ in range(count - 1)]
        for worker in self._others:
            self._pool.submit(self._begin, worker, content)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()  # those that go on, where the main thread is interrupted (Ctrl-C) or fails
        self._pool.shutdown()
        for worker in self._others:
            worker.close()

    def order(self, muscles: list[str]) -> list[str]:
        """Return muscles in the order to submit them: where there are several workers the longest first.

        Then no worker is left with a long one at the end.
        """
        return sorted(muscles, key=lambda name: -self._seconds[name]) if self._others else muscles

    def submit(self, muscle: MuscleRun) -> Future[None]:
        """Solve a muscle as soon as a worker is free; where that fails the run is stopped."""
        return self._pool.submit(self._solve, muscle)

    def stop(self) -> None:
        """Stop the run, from any thread."""
        self.stopped.set()
        for worker in self._others:
            worker.stop()

    def _begin(self, worker: _OtherProcess, content: bytes) -> None:
        try:
            worker.send(content)
            worker.receive()  # it is ready
        except ChildEndedError as error:
            if not self.stopped.is_set():
                warnings.warn(f"a process that solves muscles {error}; others solve them", stacklevel=1)
            return
        while KernelCache.grows and not self.begun.wait(_LOOK_UP) and not self.stopped.is_set():
            pass
        self._free.put(worker)

    def _solve(self, muscle: MuscleRun) -> None:
        worker = self._free.get()
        try:
            if worker is None:
                muscle.go()
            else:
                worker.solve(muscle, self)
        except BaseException:
            self.stop()
            raise
        finally:
            self._free.put(worker)


class _OtherProcess(ChildProcess):
    """A process that solves muscles of a scene, one after the other."""

    def __init__(self) -> None:
        super().__init__(_solve_muscles)
        self._solves = False

    def stop(self) -> None:
        """Tell it to stop, from any thread: the muscle that it solves ends with the frames that are done."""
        if self._solves:
            super().stop()
        else:
            self.kill()

    def solve(self, muscle: MuscleRun, workers: Workers) -> None:
        """Solve a muscle, and take over its track; raise what :meth:`MuscleRun.go` raises there."""
        self._solves, store, failure = True, muscle.run.store, None
        try:
            self.send(pickled((muscle.name, None if store is None else store.path)))
            while (message := self.receive())[0] != "ended":
                try:
                    if failure is None:
                        _pass_on(muscle, workers.warned, *message)
                except BaseException as error:  # of those who are informed
                    failure = error
                    workers.stop()
        except ChildEndedError as error:
            if workers.stopped.is_set():
                raise AbortedError(f"{muscle.name} was stopped") from None
            what = f"muscles.{muscle.name}: the process that solved it {error}"
            raise RuntimeError(f"{what}; with workers = 1 it is solved in the process that asks") from None
        finally:
            self._solves = False
        _, track, raised = message
        if not track.surfaces.files:  # frames in memory share the triangles
            track.surfaces = Frames(with_points(track.rest, points_of(one)) for one in track.surfaces)
        muscle.track.take(track)
        failure = failure or raised
        if failure is not None:
            raise failure


def _pass_on(muscle: MuscleRun, warned: dict[Any, Any], kind: str, *content: Any) -> None:
    """Pass on what a process says on the way; ``warned`` are the warnings before."""
    if kind == "warning":
        text, category, file, line = content
        warnings.warn_explicit(text, category, file, line, registry=warned)
    elif kind == "progress":
        muscle.run.report_progress(*content)
    elif muscle.run.options.observe is not None:
        muscle.run.options.observe(*content)


def _solve_muscles() -> None:
    """Solve the muscles that this process is asked for, until no more can follow; then it stops as well."""
    asker, stop, store = Asker(), Event(), None
    questions: SimpleQueue[Any] = SimpleQueue()

    def listen() -> None:
        try:
            for question in asker:
                questions.put(question)
        finally:
            stop.set()
            questions.put(None)

    def progress(*content: Any) -> None:
        asker.send(("progress", *content))

    def observe(*content: Any) -> None:
        asker.send(("frame", *content))

    def warn(message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: Any) -> None:
        asker.send(("warning", str(message), category, filename, lineno))

    Thread(target=listen, daemon=True).start()
    asked = iter(questions.get, None)
    # The one that asks may end before it has said anything, and while it is answered.
    with suppress(StopIteration, BrokenPipeError), held(), warnings.catch_warnings():
        scene, numbers, clock = next(asked)
        options = RunOptions(progress=progress, observe=observe, clock=clock)
        bones = Anatomy.of(scene).solid_bones
        asker.send("ready")
        warnings.simplefilter("always")  # the one that asks has filters
        warnings.showwarning = warn  # type: ignore[assignment]
        for name, folder in asked:
            store = store or (None if folder is None else ResultWriter(folder, scene, numbers))
            run = SceneRun(scene, numbers, bones, store, options, stop, Event())
            track, raised = MuscleTrack(), None
            try:
                MuscleRun(run, name, track).go()
            except BrokenPipeError:
                raise
            except Exception as error:
                raised = sendable(error)
            if track.failure is not None:
                track.failure = *track.failure[:2], sendable(track.failure[2])
            asker.send(("ended", track, raised))
