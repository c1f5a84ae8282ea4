"""Can pictures be rendered here? Asked of a child process, for VTK may end the process that asks."""

from __future__ import annotations

import re
import signal
import subprocess
from functools import cache

from vtkmuscle.isolation import isolated_python

_PREFLIGHT_TIMEOUT = 120.0  # seconds; a first import from a cold disk is slow
_LOG_PREFIX = re.compile(r"^.*\b(WARN|ERR)\|\s|\x1b\[[0-9;]*m")  # time, thread and level; colours
_PREFLIGHT = """
sys.modules["numpy"] = None  # VTK would load it, which takes longer than all else here
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
raise SystemExit(0 if pixel.GetNumberOfTuples() and pixel.GetTuple(0)[0] == 255 else 3)
"""


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
            timeout=_PREFLIGHT_TIMEOUT,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return f"a test picture was not finished within {_PREFLIGHT_TIMEOUT:.0f} s"
    if done.returncode == 0:
        return None
    if done.returncode < 0:
        name = signal.Signals(-done.returncode).name
        what = f"the process that rendered a test picture crashed ({name})"
    else:
        what = "a test picture could not be rendered"
    lines = [_LOG_PREFIX.sub("", line).strip() for line in done.stderr.splitlines()]
    said = [line for line in lines if line]
    return f"{what}: no usable OpenGL (on Linux, the packages libegl1 and libgl1 provide it)" + (
        f"; the last message was: {said[-1]}" if said else ""
    )
