"""Can pictures be rendered here? Asked of a child process, for VTK may end the process that asks."""

from __future__ import annotations

import re
import signal
import subprocess
from functools import cache

from vtkmuscle.isolation import isolated_python

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
    try:
        done = subprocess.run(
            isolated_python(_PREFLIGHT),
            capture_output=True,
            text=True,
            errors="replace",
            timeout=PREFLIGHT_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return too_late()
    return None if done.returncode == 0 else no_picture(done.returncode, done.stderr)


def too_late() -> str:
    """Return the reason why no picture can be rendered, where the test picture takes too long."""
    return f"a test picture was not finished within {PREFLIGHT_TIMEOUT:.0f} s"


def no_picture(status: int, said: str) -> str:
    """Return the reason why no picture can be rendered.

    Parameters
    ----------
    status : int
        Of the process that rendered a test picture; negative where a signal ended it.
    said : str
        What it wrote to stderr.
    """
    what = "a test picture could not be rendered"
    if status < 0:
        what = f"the process that rendered a test picture crashed ({signal.Signals(-status).name})"
    return f"{what}: no usable OpenGL (on Linux, the packages libegl1 and libgl1 provide it)" + last_words(
        said
    )


def last_words(said: str) -> str:
    """Return the last message that a process wrote to stderr, to be put behind a reason; "" without any."""
    lines = [_LOG_PREFIX.sub("", line).strip() for line in said.splitlines()]
    messages = [line for line in lines if line]
    return f"; the last message was: {messages[-1]}" if messages else ""
