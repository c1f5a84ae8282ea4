"""A Python process beside this one, which is asked and answers: a crash ends it alone."""

from __future__ import annotations

import io
import os
import pickle
import re
import signal
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from vtkmodules.vtkCommonDataModel import vtkDataObject

from vtkmuscle.core.machine import python_command

_LOG_PREFIX = re.compile(r"^.*\b(WARN|ERR)\|\s|\x1b\[[0-9;]*m")  # time, thread and level; colours
#: How long a process that was told to end may take to [s].
_PATIENCE = 10.0


def last_words(said: str) -> str:
    """Return the last line of a process's stderr, as the end of a sentence; "" without any."""
    lines = [_LOG_PREFIX.sub("", line).strip() for line in said.splitlines()]
    messages = [line for line in lines if line]
    return f"; the last message was: {messages[-1]}" if messages else ""


class ChildEndedError(RuntimeError):
    """A process has ended before it was done: its exit status, and what it said on stderr."""

    def __init__(self, status: int, said: str) -> None:
        super().__init__(status, said)
        self.status, self.said = status, said

    def __str__(self) -> str:
        how = f"ended with status {self.status}"
        if self.status < 0:
            how = f"crashed ({signal.Signals(-self.status).name})"
        return how + last_words(self.said)


class ChildProcess:
    """A process that runs ``serve``, a function of a module, and is talked with; it hears of no Ctrl-C.

    ``first`` is code that it runs before the package is loaded. Where it is ``quiet``, what it prints on
    stderr is only shown if it ends before its time.
    """

    def __init__(self, serve: Callable[[], None], *, first: str = "", quiet: bool = False) -> None:
        # The package may be where no other code is loaded from: the folder that somebody works in.
        root = str(Path(__file__).parents[2])
        code = f"import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n{first}\n"
        code += (
            f"sys.path.append({root!r})\nfrom {serve.__module__} import {serve.__name__}\n{serve.__name__}()"
        )
        self._stderr = tempfile.TemporaryFile() if quiet else None  # noqa: SIM115 -- closed by close()
        pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": self._stderr}
        self._process = subprocess.Popen(python_command(code), **pipes)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._questions, self._answers = self._process.stdin, self._process.stdout

    def send(self, message: bytes) -> None:
        """Send what :func:`pickled` has made; a ChildEndedError is raised where the process has ended."""
        try:
            self._questions.write(message)
            self._questions.flush()
        except (OSError, ValueError):  # ValueError: it was told to stop
            raise self._ended() from None

    def receive(self) -> Any:
        """Wait for what it sends, and return it; a ChildEndedError is raised where the process has ended."""
        try:
            return pickle.load(self._answers)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise self._ended() from None

    def stop(self) -> None:
        """Let no message follow, which tells the process to end; from any thread."""
        with suppress(OSError):  # what could not be sent is not missed
            self._questions.close()

    def kill(self) -> None:
        """End the process, whatever it does; from any thread."""
        self._process.kill()

    def close(self) -> None:
        """End the process, and close its pipes; nobody may be talking with it."""
        self.kill()
        self._process.wait()
        for file in (self._questions, self._answers, self._stderr):
            if file is not None:
                with suppress(OSError):
                    file.close()

    def _ended(self) -> ChildEndedError:
        try:
            status = self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            status = self._process.wait()
        said = b""
        if self._stderr is not None:
            self._stderr.seek(0)
            said = self._stderr.read()
        return ChildEndedError(status, said.decode("utf-8", "replace"))


class _Pickler(pickle.Pickler):
    """Takes data sets of VTK, and of what is built on it, as those of VTK."""

    def reducer_override(self, one: object) -> Any:
        if not isinstance(one, vtkDataObject):
            return NotImplemented
        # ParaView's own VTK has none, and it starts no such process.
        from vtkmodules.util.pickle_support import serialize_VTK_data_object  # noqa: PLC0415

        return serialize_VTK_data_object(one)


def pickled(one: object) -> bytes:
    """Return an object, with data sets of VTK in it, as it is sent from process to process."""
    data = io.BytesIO()
    _Pickler(data, pickle.HIGHEST_PROTOCOL).dump(one)
    return data.getvalue()


def sendable(error: Exception) -> Exception:
    """Return an error as it can be sent, with where it was raised."""
    error.add_note("".join(traceback.format_tb(error.__traceback__)))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


class Asker:
    """The process that started this one, as it is talked with from here: iterate over its questions."""

    def __init__(self) -> None:
        self._answers = os.fdopen(os.dup(1), "wb")
        os.dup2(2, 1)  # what a library prints is no answer

    def __iter__(self) -> Iterator[Any]:
        questions: BinaryIO = sys.stdin.buffer
        while True:
            try:
                yield pickle.load(questions)
            except (EOFError, pickle.UnpicklingError):  # it is done, or has ended in the midst of a question
                return

    def send(self, message: object) -> None:
        """Send it an answer; a BrokenPipeError is raised where it has ended."""
        self._answers.write(pickled(message))
        self._answers.flush()
