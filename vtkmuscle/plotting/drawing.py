"""Figures to be drawn. A child process, which a driver may end, tests off-screen rendering."""

import re
import signal
import subprocess
from base64 import b64encode
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vtkmuscle.core.machine import python_command
from vtkmuscle.plotting.views import DrawnBones

if TYPE_CHECKING:
    from vtkmuscle.plotting.studio import Studio


PREFLIGHT_TIMEOUT = 120.0  # seconds; a test picture takes 1 s, a first import from a cold disk more
#: Renders a tiny picture; ends with status 3 if the picture is empty.
TEST_PICTURE = """
sys.modules["numpy"] = None  # VTK would load it, which takes longer than all else here
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkCommonCore import vtkUnsignedCharArray
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
window = vtkRenderWindow(off_screen_rendering=True, multi_samples=0, size=(8, 8))
pixel = vtkUnsignedCharArray()
window.AddRenderer(vtkRenderer(background=(1, 0, 0)))
window.Render()
window.GetPixelData(4, 4, 4, 4, 0, pixel, 0)
if not pixel.GetNumberOfTuples() or pixel.GetTuple(0)[0] != 255:
    raise SystemExit(3)
window.Finalize()
"""
#: Prefix of messages in VTK's log: time, thread and level; colours.
_LOG_PREFIX = re.compile(r"^.*\b(WARN|ERR)\|\s|\x1b\[[0-9;]*m")


@cache
def can_render() -> str | None:
    """Return None, or the reason against off-screen pictures in words.

    A child process renders a tiny picture, once per process: without an OpenGL library, VTK may end the
    process instead of raising an error.

    Examples
    --------
    >>> from vtkmuscle.plotting import can_render
    >>> reason = can_render()
    >>> print("no pictures: " + reason if reason else "pictures can be made")  # doctest: +SKIP
    pictures can be made
    """
    options: dict[str, Any] = {"capture_output": True, "text": True, "errors": "replace"}
    try:
        done = subprocess.run(python_command(TEST_PICTURE), check=False, timeout=PREFLIGHT_TIMEOUT, **options)
    except subprocess.TimeoutExpired:
        return f"a test picture was not finished within {PREFLIGHT_TIMEOUT:.0f} s"
    if done.returncode == 0:
        return None
    what = "a test picture could not be rendered"
    if done.returncode < 0:
        what = f"the process of a test picture crashed ({signal.Signals(-done.returncode).name})"
    lines = [_LOG_PREFIX.sub("", line).strip() for line in done.stderr.splitlines()]
    last = next((f"; the last message was: {line}" for line in reversed(lines) if line), "")
    return f"{what}: no usable OpenGL (on Linux, the packages libegl1 and libgl1 provide it){last}"


@dataclass(frozen=True, eq=False)
class FigureOrder:
    """A figure to be drawn: file name, function of :mod:`vtkmuscle.plotting.figures`, arguments.

    ``rendered`` figures also take the bones and the studio.
    """

    name: str
    plot: str
    arguments: Mapping[str, Any]
    rendered: bool = False

    def write(
        self, folder: Path, bones: DrawnBones, studio: "Studio", form: str = "png", **options: float
    ) -> Path:
        """Draw the figure into a folder, of a ``width`` and ``dpi``; return the file."""
        from vtkmuscle.plotting import figures  # noqa: PLC0415 -- loads matplotlib
        from vtkmuscle.plotting.sheets import SCREEN, WIDTH, save_figure  # noqa: PLC0415

        scene = {"bones": bones, "studio": studio} if self.rendered else {}
        path, width = folder / f"{self.name}.{form}", options.get("width", WIDTH)
        figure = getattr(figures, self.plot)(**self.arguments, **scene, width=width)
        save_figure(figure, path, form, options.get("dpi", SCREEN))
        return path


def html_picture(plotter: Callable[[], Any]) -> str:
    """Return the picture of a plotter in HTML, empty where none can be rendered."""
    if can_render() is not None:
        return ""
    shown, file = plotter(), BytesIO()
    shown.screenshot(file)
    shown.close()
    return f'<img width="480" src="data:image/png;base64,{b64encode(file.getvalue()).decode()}"/>'
