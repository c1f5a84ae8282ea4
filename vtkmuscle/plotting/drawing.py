"""Figures drawn by a process of its own, beside what the process that asks for them goes on with.

Drawing takes seconds of Python, which threads that solve would wait for; and VTK may end the process that
renders, where a driver is at fault. So a child process is asked first whether pictures can be rendered here.
"""

from __future__ import annotations

import io
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkMultiBlockDataSet, vtkPolyData

import vtkmuscle.plotting
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import blocks_of, multiblock_from
from vtkmuscle.data.drawn_bones import DrawnBone, DrawnBones
from vtkmuscle.isolation import isolated_python

if TYPE_CHECKING:
    from vtkmuscle.plotting.studio import Studio


PREFLIGHT_TIMEOUT = 120.0  # seconds; a first import from a cold disk is slow
_LOG_PREFIX = re.compile(r"^.*\b(WARN|ERR)\|\s|\x1b\[[0-9;]*m")  # time, thread and level; colours
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
        done = subprocess.run(isolated_python(_PREFLIGHT), check=False, timeout=PREFLIGHT_TIMEOUT, **options)
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


def last_words(said: str) -> str:
    """Return the last line of a process's stderr, as the end of a sentence; "" without any."""
    lines = [_LOG_PREFIX.sub("", line).strip() for line in said.splitlines()]
    messages = [line for line in lines if line]
    return f"; the last message was: {messages[-1]}" if messages else ""


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


#: Of numbers on the pipes between the processes.
_PROTOCOL = 5
#: How long a process that was told to end may take to [s].
_PATIENCE = 10.0


class DrawingEndedError(RuntimeError):
    """The process that draws has ended before it was done; says why."""


class DrawingProcess:
    """A process that draws figures one after the other; a crash of its driver ends it alone.

    It loads its libraries, renders a test picture, and reduces the ``bones``: named blocks of triangles.
    """

    def __init__(self, bones: vtkMultiBlockDataSet) -> None:
        # The package may be where no other code is loaded from: the folder that somebody works in.
        root = str(Path(__file__).parents[2])
        code = f"{TEST_PICTURE}\nsys.path.append({root!r})\nfrom {__name__} import _work\n_work()"
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 -- closed by close()
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": self._stderr}
        self._process = subprocess.Popen(isolated_python(code), **pipes)
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
        return self._talk.submit(self._ask, _pickled((order, folder)))

    def bones(self) -> Mapping[str, DrawnBone]:
        """Wait for the bones as they are drawn, and return them; or raise DrawingEndedError."""
        return self._bones.result()

    def close(self) -> None:
        """End the process, whatever it does."""
        self._watch.cancel()
        self._process.kill()
        self._process.wait()
        self._talk.shutdown(cancel_futures=True)
        for file in (self._process.stdin, self._process.stdout, self._stderr):
            assert file is not None
            with suppress(OSError):  # what could not be sent is not missed
                file.close()

    def _begin(self, bones: vtkMultiBlockDataSet) -> Mapping[str, DrawnBone]:
        self._receive()  # it has rendered the test picture
        self._watch.cancel()
        self._ready = True
        return self._ask(_pickled(dict(blocks_of(bones))))  # type: ignore[no-any-return]

    def _give_up(self) -> None:
        self._late.set()
        self._process.kill()

    def _ask(self, question: bytes) -> Any:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(question)
            self._process.stdin.flush()
        except OSError:
            raise DrawingEndedError(self._why()) from None
        return self._receive()

    def _receive(self) -> Any:
        assert self._process.stdout is not None
        try:
            answer = pickle.load(self._process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise DrawingEndedError(self._why()) from None
        if isinstance(answer, Exception):
            raise answer
        return answer

    def _why(self) -> str:
        """Return in words why the process has ended."""
        try:
            status = self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            status = self._process.wait()
        if self._late.is_set():
            return too_late()
        self._stderr.seek(0)
        said = self._stderr.read().decode("utf-8", "replace")
        if not self._ready:
            return no_picture(status, said)
        how = f"crashed ({signal.Signals(-status).name})" if status < 0 else f"ended with status {status}"
        return f"the process that draws {how}{last_words(said)}"


class _Pickler(pickle.Pickler):
    """Takes data sets of VTK, and of what is built on it, as those of VTK."""

    def reducer_override(self, one: object) -> Any:
        if not isinstance(one, vtkDataObject):
            return NotImplemented
        # ParaView's own VTK has none, and it draws no figures.
        from vtkmodules.util.pickle_support import serialize_VTK_data_object  # noqa: PLC0415

        return serialize_VTK_data_object(one)


def _pickled(one: object) -> bytes:
    data = io.BytesIO()
    _Pickler(data, _PROTOCOL).dump(one)
    return data.getvalue()


def _work() -> None:
    """Do what the process is there for, until its input ends: the one that asks is done, or has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the one that asks, who ends this one
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer

    def answer(found: Any) -> None:
        pickle.dump(found, answers, _PROTOCOL)
        answers.flush()

    answer(None)
    import matplotlib as mpl  # noqa: PLC0415 -- the process that asks needs none

    from vtkmuscle.plotting.studio import Studio  # noqa: PLC0415

    mpl.rcdefaults()  # a matplotlibrc in the working folder may be from elsewhere
    with suppress(EOFError, BrokenPipeError), Studio() as studio:
        bones = DrawnBones(multiblock_from(pickle.load(sys.stdin.buffer)))
        bones.spread()
        answer(bones.by_name)
        while True:
            order, folder = pickle.load(sys.stdin.buffer)
            before = time.perf_counter()
            try:
                answer((order.write(folder, bones, studio), time.perf_counter() - before))
            except BrokenPipeError:
                raise
            except Exception as error:
                answer(_sendable(error))


def _sendable(error: Exception) -> Exception:
    """Return an error as it can be sent, with where it was raised."""
    error.add_note("".join(traceback.format_tb(error.__traceback__)))
    try:
        pickle.loads(pickle.dumps(error, _PROTOCOL))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
