"""Processes that are stopped, disks that run full, and what is left then."""

import csv
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree

import pytest

from vtkmuscle.io import read_polydata
from vtkmuscle.run.store import MuscleNote, RunNote, read_note

#: The program, in a process of its own, with this one's packages.
PROGRAM = (sys.executable, "-m", "vtkmuscle")


def started(*arguments, limit=None):
    """Start the program; limit is what it may write to a file [bytes]."""
    command = [*PROGRAM, *map(str, arguments)]
    if limit is not None:
        code = (
            "import os, resource, sys\nresource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)\n"
        )
        code += "os.execv(sys.argv[2], sys.argv[2:])"
        command = [sys.executable, "-c", code, str(limit), *command]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(process, timeout=60.0):
    """Wait for a process, and return its status, output and errors; one that hangs is a failure."""
    try:
        out, err = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        pytest.fail(f"the program did not end within {timeout:.0f} s: {process.args}")
    return process.returncode, out, err


def killed_at(process, seconds, number=signal.SIGKILL):
    """Send a signal after some time; return whether the process had not ended before."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        if process.poll() is not None:
            return False
        time.sleep(0.005)
    process.send_signal(number)
    return True


def files_in(collection: Path) -> list[Path]:
    """Return the files that a ParaView collection lists."""
    entries = ElementTree.parse(collection).iter("DataSet")
    return [collection.parent / entry.attrib["file"] for entry in entries]


def check_whole(folder: Path) -> int:
    """Check that every file under a final name in a folder can be read to its end, and return how many."""
    count = 0
    for path in folder.rglob("*"):
        if not path.is_file() or path.name.startswith("."):
            continue
        count += 1
        if path.suffix == ".vtp":
            assert read_polydata(path).GetNumberOfPoints()
        elif path.suffix == ".pvd":
            assert all(read_polydata(file).GetNumberOfPoints() for file in files_in(path)), path
        elif path.suffix == ".csv":
            with path.open(newline="") as lines:
                rows = list(csv.reader(lines))
            assert rows
            assert len({len(row) for row in rows}) == 1, path
        elif path.parent.name == "finished" and path.suffix == ".json" and path.name != "report.json":
            read_note(path, RunNote if path.stem == "scene" else MuscleNote)
        elif path.suffix == ".json":
            json.loads(path.read_text())
        elif path.suffix == ".html":
            assert path.read_text(encoding="utf-8").endswith("</html>\n")
        else:
            assert path.suffix == ".png", path
            assert path.read_bytes()[-8:-4] == b"IEND"
    return count


def results(folder: Path):
    """Return what two runs of the same scene have in common: all but times."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = path.relative_to(folder).as_posix()
        if path.suffix == ".vtp":
            data = read_polydata(path)
            found[name] = bytes(memoryview(data.GetPoints().GetData()))
        elif path.suffix in (".csv", ".pvd"):
            found[name] = path.read_bytes()
    return found


@contextmanager
def small_disk(folder: Path, kilobytes: int):
    """Mount a small disk in memory; skip where the system does not allow it."""
    folder.mkdir(exist_ok=True)
    command = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "none", str(folder)]
    allowed = os.name == "posix" and os.geteuid() == 0
    if not allowed or subprocess.run(command, check=False, capture_output=True).returncode:
        pytest.skip("this system lets nobody here mount a small disk")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def children(pid):
    """Return the processes that a process has started, and those that they have."""
    try:
        command = ["ps", "-o", "pid=", "--ppid", str(pid)]
        text = subprocess.run(command, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("there is no ps")
    found = [int(word) for word in text.stdout.split()]
    return [*found, *(one for child in found for one in children(child))]
