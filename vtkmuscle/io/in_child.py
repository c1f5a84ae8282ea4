"""Read files by VTK in a process of its own, for VTK may end the process that reads a damaged file.

One process reads all files of a run: it starts with the first one, ends with this process, and where a file
ends it the next file has a new one. Programs that are no Python, such as ParaView, read files themselves.
"""

from __future__ import annotations

import atexit
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Lock

from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkIOLegacy import vtkPolyDataReader

from vtkmuscle.core.errors import InputError
from vtkmuscle.io.child_reader import read
from vtkmuscle.isolation import isolated_python

#: The longest that the reading of a file may take, whatever its size [s], and what is read in a second of a
#: large one at least [bytes/s].
LONGEST, _SPEED = 20.0, 1e7

_REMEDY = "export it again, and check that its suffix says what it is"


def read_in_child(path: Path, module: str, reader: str) -> vtkPolyData:
    """Read poly data by one of VTK's readers.

    Parameters
    ----------
    path : Path
        The file.
    module, reader : str
        Names of the reader's module and class.

    Raises
    ------
    ValueError
        If VTK complained, ended the process or did not end, or the file holds something else.
    """
    kind, said, content = _child.ask(path, module, reader, wanted=True)
    if said:
        raise InputError(path, f"the file cannot be read as {path.suffix}: {said}", _REMEDY)
    if kind != "vtkPolyData":
        raise InputError(
            path,
            f"the file holds a {kind or 'nothing'}, not a surface",
            "extract its surface (pyvista: mesh.extract_surface()) and save that",
        )
    again = vtkPolyDataReader()
    again.ReadFromInputStringOn()
    again.SetBinaryInputString(content, len(content))  # type: ignore[arg-type]
    again.Update()
    result: vtkPolyData = again.GetOutput()
    return result


def check_in_child(path: Path, module: str, reader: str) -> None:
    """Check that one of VTK's readers can read all time steps of a file.

    Parameters
    ----------
    path, module, reader
        As of :func:`read_in_child`.

    Raises
    ------
    ValueError
        If it cannot.
    """
    _, said, _ = _child.ask(path, module, reader, wanted=False)
    if said:
        raise InputError(path, "the file is damaged", "write it again")


def _is_python() -> bool:
    """Return whether this program is a Python to be started: ParaView names itself, or no file."""
    program = Path(sys.executable or "-")
    return program.name.startswith("python") and program.is_file()


class _Child:
    """The process, where there is one."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0

    def ask(self, path: Path, module: str, reader: str, *, wanted: bool) -> tuple[str, str, bytes]:
        """Return the class of what a file holds, what VTK said, and the data."""
        if not _is_python():
            return read(os.path.abspath(path), module, reader, wanted=wanted)
        longest = LONGEST + path.stat().st_size / _SPEED
        question = json.dumps([os.path.abspath(path), module, reader, longest, wanted])
        with self._lock:
            process = self._running()
            assert process.stdin is not None
            assert process.stdout is not None
            began = time.monotonic()
            try:
                process.stdin.write(question.encode() + b"\n")
                process.stdin.flush()
                line = process.stdout.readline()
                kind, said, length = json.loads(line) if line else ("", "", 0)
                content = process.stdout.read(length)
            except BaseException:  # the answer is not for the next one to ask
                process.kill()
                raise
            if line:
                return kind, said, content
            code = process.wait()
        if time.monotonic() - began >= longest:
            raise InputError(path, f"the file was not read within {longest:.0f} s", _REMEDY)
        name = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        problem = f"the file is damaged, or takes too much memory: VTK's reader ended with {name}"
        raise InputError(path, problem, _REMEDY)

    def _running(self) -> subprocess.Popen[bytes]:
        """Return the process: a new one where there is none, it has ended, or is that of a parent."""
        if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
            self.close()
            self._owner = os.getpid()
            # The package may be where no other code is loaded from: the folder that somebody works in.
            root = str(Path(__file__).parents[2])
            self._process = subprocess.Popen(
                isolated_python(f"sys.path.append({root!r})\nfrom {read.__module__} import serve\nserve()"),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
        return self._process

    def close(self) -> None:
        """End the process of this one, which reads no further file."""
        process, self._process = self._process, None
        if process is not None and self._owner == os.getpid():
            process.communicate()


_child = _Child()
atexit.register(_child.close)
