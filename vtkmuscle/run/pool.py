"""Processes that solve muscles and draw figures. Python's lock is held for 0.72 of the time of a frame."""

import os
import pickle
import signal
import time
import warnings
from concurrent.futures import Future
from contextlib import ExitStack
from multiprocessing import parent_process
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import TYPE_CHECKING, Any

from vtkmuscle.core.machine import is_python, processors
from vtkmuscle.core.mesh.shared import keep_shared
from vtkmuscle.data.arrays import points_of, with_points
from vtkmuscle.io.children import child_context, processes
from vtkmuscle.plotting.drawing import FigureOrder
from vtkmuscle.plotting.views import DrawnBones
from vtkmuscle.run.frames import Frames, MuscleTrack, RunOptions
from vtkmuscle.run.muscles import MuscleRun, SceneRun
from vtkmuscle.scene.data import SceneData

if TYPE_CHECKING:
    from vtkmuscle.plotting.studio import Studio

#: Said where a process of the pool ended before its work was done.
ENDED = "a worker process ended early: killed, or out of memory; use fewer workers"


def pool_size(scene: SceneData, workers: int | None) -> int:
    """Return the number of processes for a scene."""
    if scene.muscle_contact != "off" or not is_python():
        return 1
    return min(processors() if workers is None else workers, len(scene.muscles))


class Pool(ExitStack):
    """Processes that solve muscles, and others that draw, until the end of the pool's context.

    At most ``size`` solve, and half as many draw, started on demand: a driver that ends a drawing process
    ends no muscle. Muscles of a run with a store are written once ``checked`` is set.
    """

    def __init__(self, size: int, run: SceneRun) -> None:
        # VTK's data sets are pickled by this module of VTK. ParaView's VTK lacks it, and uses no pool.
        import vtkmodules.util.pickle_support  # noqa: F401, PLC0415

        super().__init__()
        context = child_context()
        self._messages, self.checked = context.SimpleQueue(), context.Event()
        self._warned: dict[Any, Any] = {}
        # What is large goes through files: a pipe that nobody reads any more would be written to for ever.
        self._folder = Path(self.enter_context(TemporaryDirectory()))
        inputs = self._file("run", (run.scene, run.numbers, run.store, run.options.clock, run.only))
        solving, drawing = (inputs, self._messages, self.checked), (self._folder / "bones", self._messages)
        self._drawers = self.enter_context(processes(max(size // 2, 1), _begin_drawing, drawing))
        self._solvers = self.enter_context(processes(size, _begin, solving))

    def solve(self, muscle: str) -> Future[Path]:
        """Solve a muscle in the next free process; the result is for :func:`track_in`."""
        return self._solvers.submit(_solve, muscle, self._folder / f"muscle {muscle}")

    def draw(self, order: FigureOrder, folder: Path, bones: DrawnBones) -> Future[float]:
        """Draw a figure in the next free process; the result is the drawing time [s]."""
        if not (self._folder / "bones").exists():
            self._file("bones", bones)
        return self._drawers.submit(_draw, self._file(f"figure {order.name}", order), folder)

    def pass_on(self, options: RunOptions) -> None:
        """Pass on progress and warnings of the processes."""
        while not self._messages.empty():
            kind, *content = self._messages.get()
            if kind == "warning":
                text, category, file, line = content
                warnings.warn_explicit(text, category, file, line, registry=self._warned)
            elif options.progress is not None:
                options.progress(*content)

    def _file(self, name: str, content: object) -> Path:
        path = self._folder / name
        path.write_bytes(pickle.dumps(content))
        return path


def track_in(path: Path) -> MuscleTrack:
    """Return the track written by a process of a pool; frames in memory share triangles."""
    track: MuscleTrack = pickle.loads(path.read_bytes())
    path.unlink()
    if track.rest is not None and not track.surfaces.files:
        track.surfaces = Frames(with_points(track.rest, points_of(frame)) for frame in track.surfaces)
    return track


class _Worker:
    """The state of a process of the pool."""

    run: SceneRun
    bones: DrawnBones
    studio: "Studio | None" = None


#: Contexts open until the process of the pool ends.
_open = ExitStack()


def _begin(inputs: Path, messages: Any, checked: Any) -> None:
    """Prepare a process that solves muscles."""
    _join(messages)
    scene, numbers, store, clock, only = pickle.loads(inputs.read_bytes())
    _open.enter_context(keep_shared())  # all muscles of this process share bones
    options = RunOptions(progress=lambda *content: messages.put(("progress", *content)), clock=clock)
    _Worker.run = SceneRun(scene, numbers, store, options, only, checked=checked)


def _begin_drawing(bones: Path, messages: Any) -> None:
    """Prepare a process that draws."""
    _join(messages)
    _Worker.bones = pickle.loads(bones.read_bytes())


def _join(messages: Any) -> None:
    """Let a process end with its parent process, and send its warnings there."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Thread(target=_end_with_parent, daemon=True).start()

    def warn(message: Warning | str, category: type[Warning], filename: str, lineno: int, *_: Any) -> None:
        messages.put(("warning", str(message), category, filename, lineno))

    warnings.simplefilter("always")  # the process that started this one filters them
    warnings.showwarning = warn  # type: ignore[assignment]


def _end_with_parent() -> None:
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def _solve(name: str, path: Path) -> Path:
    muscle = MuscleRun(_Worker.run, name)
    muscle.go()
    path.write_bytes(pickle.dumps(muscle.track))
    return path


def _draw(inputs: Path, folder: Path) -> float:
    order: FigureOrder = pickle.loads(inputs.read_bytes())
    before = time.perf_counter()
    if _Worker.studio is None:
        from vtkmuscle.plotting.sheets import DOTS_PER_INCH, SCREEN, set_style  # noqa: PLC0415 -- figures need it
        from vtkmuscle.plotting.studio import Studio  # noqa: PLC0415

        set_style()
        _Worker.studio = Studio(SCREEN / DOTS_PER_INCH)
    order.write(folder, _Worker.bones, _Worker.studio)
    return time.perf_counter() - before
