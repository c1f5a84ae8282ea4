"""What is done with a damaged scene: it is read, and its first frames are run."""

from __future__ import annotations

import signal
import warnings
from pathlib import Path

from vtkmuscle import Scene

#: A case that takes longer hangs, and ends the process [s].
LONGEST = 60


def load_and_run(path: Path) -> None:
    """Read a scene, run a frame of it, and raise what is wrong with it."""
    signal.alarm(LONGEST)
    warnings.simplefilter("ignore")
    before = sorted(path.parent.rglob("*"))
    out = path.parent.parent / f"out_{path.parent.name}"
    try:
        Scene.load(path).run(out, frames="0:1", figures=False)
    except (ValueError, OSError) as error:
        lines, faults = str(error).splitlines(), getattr(error, "faults", [error])
        assert len(lines) <= len(faults), lines
        assert all(len(line) < 1000 for line in lines), lines
        raise
    finally:
        signal.alarm(0)
        assert sorted(path.parent.rglob("*")) == before, "stray files"
        assert not list(out.rglob(".*")), "left behind"
