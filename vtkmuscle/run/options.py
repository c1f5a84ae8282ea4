"""Options of a run: frames, output and callbacks."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from typing import Any, Self

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import suggestion

Progress = Callable[[str, str, float], None]
#: Frames to keep, in the words of a user.
Frames = str | slice | range | int | None
Observe = Callable[[str, Mapping[str, Any]], None]


@dataclass(frozen=True, kw_only=True)
class RunOptions:
    """The options of a run.

    Attributes
    ----------
    frames : str, slice, range, int or None
        Frames to keep and write, e.g. ``"0:10"`` for the first ten (the end is not included, as in Python);
        default all. The deformer ``"pbd"`` goes on from frame to frame, so earlier frames are computed too.
    workers : int or None
        Number of processes for solving muscles side by side and drawing figures; None: one per processor.
        Muscles that may meet, and a single muscle, are solved in this process. So are all muscles by default.
        The result does not depend on the number of processes.
    figures : bool
        Draw figures. Without OpenGL a warning is given and the remaining output is written.
    report : bool
        Write report.html: the scene to be turned and moved, curves, tables and verdicts, for a browser.
    overwrite : bool
        Whether results of a different scene in the folder, or files from outside of runs, may be replaced.
        The scene's own files are never replaced.
    fresh : bool
        Compute the folder's finished muscles again.
    sense : bool
        Check before the run whether the scene is plausible.
    progress : callable or None
        Called with the muscle's name, the stage, and the finished part, 0 to 1; from any thread.
    observe : callable or None
        Called with the muscle's name and the report's numbers of each finished frame; from any thread.
    clock : callable
        Clock for the stages of muscles [s]; a function of a module, because all processes use the clock.

    Raises
    ------
    ValueError
        If an option is not allowed; the message names the allowed options.
    """

    frames: Frames = None
    workers: int | None = 1
    figures: bool = True
    report: bool = True
    overwrite: bool = False
    fresh: bool = False
    sense: bool = True
    progress: Progress | None = None
    observe: Observe | None = None
    clock: Callable[[], float] = time.perf_counter

    def __post_init__(self) -> None:
        if self.workers is not None and self.workers < 1:
            raise InputError("", f"workers is {self.workers}, but must be an integer >= 1")

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Self:
        """Return options by name.

        An unknown name raises a TypeError.
        """
        names = [field.name for field in fields(cls)]
        for name in given:
            if name not in names:
                raise TypeError(f"a run has no option {name!r}; {suggestion(name, names)}")
        return cls(**given)


def frame_numbers(frames: str | slice | range | int | None, count: int) -> range:
    """Return the frame numbers selected from ``count`` frames.

    Ascending and not empty. ``frames`` is ``"A:B"`` or ``"A:B:STEP"`` as in Python (B is not included),
    ``"A"`` or an int for a single frame, a slice or range, or None for all. Invalid values raise a
    ValueError.

    Examples
    --------
    >>> from vtkmuscle.run import frame_numbers
    >>> frame_numbers("40:", 46)
    range(40, 46)
    """
    allowed = f"give A:B with 0 <= A < B <= {count} (B is not included), or one frame, 0 to {count - 1}"
    wanted = frames
    if isinstance(wanted, str):
        parts = wanted.split(":")
        try:
            bounds = [int(part) if part.strip() else None for part in parts]
            wanted = slice(*bounds) if len(parts) > 1 else int(parts[0])
        except (ValueError, TypeError):
            raise InputError("", f"frames {frames!r} cannot be understood", allowed) from None
    if wanted is None:
        return range(count)
    if isinstance(wanted, slice):
        if wanted.step is not None and wanted.step <= 0:
            raise InputError("", f"frames {frames!r} must ascend", allowed)
        numbers = range(*wanted.indices(count))
    else:
        numbers = wanted if isinstance(wanted, range) else range(wanted, wanted + 1)
    if not len(numbers) or numbers.step < 0 or numbers[0] < 0 or numbers[-1] >= count:
        raise InputError("", f"frames {frames!r}: the motion has {count} frames", allowed)
    return numbers
