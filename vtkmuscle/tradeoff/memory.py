"""How much memory a piece of work took at its peak."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_STATUS = Path("/proc/self/status")
_CLEAR = Path("/proc/self/clear_refs")
#: Written to clear_refs it sets the peak to what is in use now (proc(5)).
_RESET_PEAK = "5"


class PeakMemory:
    """Memory that was in use at the peak beyond that in use before.

    Attributes
    ----------
    megabytes : float or None
        None where the system does not tell.
    """

    megabytes: float | None = None


@contextmanager
def peak_memory() -> Iterator[PeakMemory]:
    """Measure the resident memory that a piece of work adds at its peak; Linux only, elsewhere None."""
    found = PeakMemory()
    gc.collect()
    try:
        _CLEAR.write_text(_RESET_PEAK, encoding="ascii")
        before = _resident("VmRSS")
    except OSError:
        yield found
        return
    yield found
    found.megabytes = max(_resident("VmHWM") - before, 0.0)


def _resident(word: str) -> float:
    """Return an entry of the process's status [MB]."""
    for line in _STATUS.read_text(encoding="ascii").splitlines():
        if line.startswith(f"{word}:"):
            return float(line.split()[1]) * 1024 / 1e6
    raise OSError(f"{_STATUS} has no {word}")
