"""Figures drawn by a process of its own, beside what the process that asks for them goes on with.

Drawing takes seconds of Python, which threads that solve would wait for; and VTK may end the process that
renders, where a driver is at fault. So a child process is asked first whether pictures can be rendered here.
"""

from __future__ import annotations

import signal
import subprocess
import threading
import time
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

import vtkmuscle.plotting
from vtkmuscle.core.machine import python_command
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import blocks_of, multiblock_from
from vtkmuscle.data.drawn_bones import DrawnBone, DrawnBones
from vtkmuscle.io.child_process import Asker, ChildEndedError, ChildProcess, last_words, pickled, sendable

if TYPE_CHECKING:
    from vtkmuscle.plotting.studio import Studio


PREFLIGHT_TIMEOUT = 120.0  # seconds; a first import from a cold disk is slow
#: Renders a tiny picture, and ends with status 3 where that comes to nothing.
TEST_PICTURE = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
renderer, window, pixel = vtkRenderer(), vtkRenderWindow(), vtkUnsignedCharArray()
renderer.SetBackground(1, 0, 0)
window.SetOffScreenRendering(True)
window.SetMultiSamples(0)
window.SetSize(8, 8)
window.AddRenderer(renderer)
window.Render()
window.GetPixelData(4, 4, 4, 4, 0, pixel, 0)
if not pixel.GetNumberOfTuples() or pixel.GetTuple(0)[0] != 255:
    raise SystemExit(3)
window.Finalize()
"""
_PREFLIGHT = f"""
sys.modules["numpy"] = None  # VTK would load it, which takes longer than all else here
{TEST_PICTURE}"""


@cache
def can_render() -> str | None:
    """Return None if pictures can be rendered off-screen here, or else the reason why not.

    A tiny picture is rendered in a child process, once per process: without an OpenGL library VTK does
    not raise an error but may end the process.

    Returns
    -------
    str or None
        The reason in words, for the user.

    Examples
    --------
    >>> from vtkmuscle.plotting import can_render
    >>> reason = can_render()
    >>> print("no pictures: " + reason if reason else "pictures can be made")  # doctest: +SKIP
    pictures can be made
    """
    options: dict[str, Any] = {"capture_output": True, "text": True, "errors": "replace"}
    try:
        done = subprocess.run(python_command(_PREFLIGHT), check=False, timeout=PREFLIGHT_TIMEOUT, **options)
    except subprocess.TimeoutExpired:
        return too_late()
    return None if done.returncode == 0 else no_picture(done.returncode, done.stderr)


def too_late() -> str:
    """Return the reason why no picture can be rendered, where the test picture takes too long."""
    return f"a test picture was not finished within {PREFLIGHT_TIMEOUT:.0f} s"


def no_picture(status: int, said: str) -> str:
    """Return the reason why no picture can be rendered, from a process's exit status and its stderr."""
    what = "a test picture could not be rendered"
    if status < 0:
        what = f"the process that rendered a test picture crashed ({signal.Signals(-status).name})"
    where = "no usable OpenGL (on Linux, the packages libegl1 and libgl1 provide it)"
    return f"{what}: {where}{last_words(said)}"


class MuscleFrame(NamedTuple):
    """A muscle in a frame: its surface, the bones' transforms from rest, its fibres, and words above it."""

    muscle: vtkPolyData
    transforms: Mapping[str, Floats]
    fibres: vtkPolyData | None = None
    label: str = ""


@dataclass(frozen=True, eq=False)
class FigureOrder:
    """A figure to be drawn: its file's name, and a function of :mod:`vtkmuscle.plotting` with its arguments.

    The bones and the studio are arguments of those that are ``rendered``.
    """

    name: str
    plot: str
    given: Mapping[str, Any]
    rendered: bool = False

    def write(
        self, folder: Path, bones: DrawnBones, studio: Studio, form: str = "png", dpi: float = 150.0
    ) -> Path:
        """Draw it, and return the file in a folder, which is made where it does not exist."""
        from vtkmuscle.plotting.sheets import save_figure  # noqa: PLC0415 -- loads matplotlib

        folder.mkdir(parents=True, exist_ok=True)
        scene = {"bones": bones, "studio": studio} if self.rendered else {}
        path = folder / f"{self.name}.{form}"
        save_figure(getattr(vtkmuscle.plotting, self.plot)(**self.given, **scene), path, dpi)
        return path


class DrawingEndedError(RuntimeError):
    """The process that draws has ended before it was done; says why."""


class DrawingProcess:
    """A process that draws figures one after the other; a crash of its driver ends it alone.

    It loads its libraries, renders a test picture, and reduces the ``bones``: named blocks of triangles.
    """

    def __init__(self, bones: vtkMultiBlockDataSet) -> None:
        self._process = ChildProcess(_draw, first=TEST_PICTURE, quiet=True)
        self._late = threading.Event()
        self._watch = threading.Timer(PREFLIGHT_TIMEOUT, self._give_up)
        self._watch.daemon = True
        self._watch.start()
        self._ready = False
        self._talk = ThreadPoolExecutor(1, "drawing")
        self._bones = self._talk.submit(self._begin, bones)

    def draw(self, order: FigureOrder, folder: Path) -> Future[tuple[Path, float]]:
        """Send a figure to be drawn into a folder; the future has the file and the time it took [s].

        The future raises the error of drawing, or DrawingEndedError.
        """
        return self._talk.submit(self._ask, pickled((order, folder)))

    def bones(self) -> Mapping[str, DrawnBone]:
        """Wait for the bones as they are drawn, and return them; or raise DrawingEndedError."""
        return self._bones.result()

    def close(self) -> None:
        """End the process, whatever it does."""
        self._watch.cancel()
        self._process.kill()
        self._talk.shutdown(cancel_futures=True)
        self._process.close()

    def _begin(self, bones: vtkMultiBlockDataSet) -> Mapping[str, DrawnBone]:
        self._ask(b"")  # it has rendered the test picture
        self._watch.cancel()
        self._ready = True
        return self._ask(pickled(dict(blocks_of(bones))))  # type: ignore[no-any-return]

    def _give_up(self) -> None:
        self._late.set()
        self._process.kill()

    def _ask(self, question: bytes) -> Any:
        try:
            self._process.send(question)
            answer = self._process.receive()
        except ChildEndedError as error:
            raise DrawingEndedError(self._reason(error)) from None
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _reason(self, error: ChildEndedError) -> str:
        if self._late.is_set():
            return too_late()
        return f"the process that draws {error}" if self._ready else no_picture(error.status, error.said)


def _draw() -> None:
    """Draw what this process is asked to, the bones first."""
    asker = Asker()
    asker.send(None)
    import matplotlib as mpl  # noqa: PLC0415 -- the process that asks needs none

    from vtkmuscle.plotting.studio import Studio  # noqa: PLC0415

    mpl.rcdefaults()  # a matplotlibrc in the working folder may be from elsewhere
    # The one that asks may end before it has said anything, and while it is answered.
    with suppress(StopIteration, BrokenPipeError), Studio() as studio:
        orders = iter(asker)
        bones = DrawnBones(multiblock_from(next(orders)))
        bones.spread()
        asker.send(bones.by_name)
        for order, folder in orders:
            before = time.perf_counter()
            try:
                drawn = order.write(folder, bones, studio), time.perf_counter() - before
            except Exception as error:
                asker.send(sendable(error))
            else:
                asker.send(drawn)
