"""What is done with what is damaged: a scene is run, a run goes on into its results."""

from __future__ import annotations

import signal
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vtkmuscle import Result, Scene

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
    """Run a scene into damaged results of it, and read them: they are those of a whole run again."""
    scene, whole = out.parent / "scene" / "scene.toml", out.parent / "whole"
    with one_clear_error(scene, out):
        Scene.load(scene).run(out, frames="0:2", figures=False)
        result = Result.load(out)
        for name in ("lengths.csv", "fibre_lengths.csv"):
            assert (out / name).read_bytes() == (whole / name).read_bytes(), name
        result.muscle("spindle", frame=1), result.write_report(out / "again.html")
