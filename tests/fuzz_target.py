"""What is done with what is damaged: a scene is run, a run goes on into its results."""

import json
import os
import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from typer.testing import CliRunner

from vtkmuscle import Result, Scene

#: Where a case of a command has its words, in its folder.
WORDS = "command.json"
#: A case that takes longer hangs, and ends the process [s].
LONGEST = 60


@contextmanager
def one_clear_error(scene: Path, out: Path) -> Iterator[None]:
    """Check that what is raised within is a line for each fault, and that nothing is left behind."""
    signal.alarm(LONGEST)
    warnings.simplefilter("ignore")
    before = sorted(scene.parent.rglob("*"))
    try:
        yield
    except (ValueError, OSError) as error:
        lines, faults = str(error).splitlines(), getattr(error, "faults", [error])
        assert len(lines) <= len(faults), lines
        assert all(len(line) < 1000 for line in lines), lines
        raise
    finally:
        signal.alarm(0)
        assert sorted(scene.parent.rglob("*")) == before, "stray files"
        assert not list(out.rglob(".*")), "left behind"


def load_and_run(path: Path) -> None:
    """Read a scene, run a frame of it, and raise what is wrong with it."""
    out = path.parent.parent / f"out_{path.parent.name}"
    with one_clear_error(path, out):
        Scene.load(path).run(out, frames="0:1", figures=False)


def go_on(out: Path) -> None:
    """Run a scene into damaged results of it, and read them."""
    scene = out.parent / "scene" / "scene.toml"
    with one_clear_error(scene, out):
        Scene.load(scene).run(out, frames="0:2", figures=False)
        result = Result.load(out)
        result.muscle("spindle", frame=1), result.write_report(out / "again.html")


def command(folder: Path) -> None:
    """Give a command of the program its words, in a folder with damaged files."""
    from vtkmuscle.cli import Status, app
    from vtkmuscle.io.writing import RECORD

    os.chdir(folder)
    words = json.loads((folder / WORDS).read_text())
    signal.alarm(LONGEST)
    done = CliRunner().invoke(app, words, catch_exceptions=False)
    signal.alarm(0)
    lines = done.stderr.splitlines()
    assert all(len(line) < 1000 for line in lines), lines
    assert {path.name for path in folder.rglob(".*")} <= {RECORD}, "left behind"
    if done.exit_code == Status.BAD_INPUT:
        errors = [line for line in lines if line.startswith("error: ")]
        assert errors, lines
        assert all(line.startswith(("error: ", "warning: ")) for line in lines), lines
        raise ValueError(done.stderr)
    assert done.exit_code in (0, Status.FAILED), done.exit_code
