"""Where processor time goes, by stacks of calls: all threads of a process, looked at every few milliseconds.

At each look the time that a thread has used since the last one counts as that of the calls that it is in
then, so that the sum over the stacks is the time used, whatever each look meets. A compiled kernel counts as
the function that calls it. Only Linux has clocks of other threads.
"""

from __future__ import annotations

import sys
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cache
from types import CodeType
from typing import Self

#: Time between two looks [s].
INTERVAL = 0.005
#: How soon a thread lets the one that looks have Python's lock [s]. With the usual 5 ms it is met where it
#: next gives the lock away: calls of VTK seem to take up to seven times as long as they do.
SWITCH = 5e-5
#: The stage of what belongs to no other.
OTHER = "remainder"

#: Calls from outside in: each the file within its package, a colon, and its name there.
Stack = tuple[str, ...]


class Sampling:
    """Samples the threads of this process while it is open, as a context.

    Attributes
    ----------
    seconds : Counter of tuple of str
        Processor time by stack [s], once it is closed. That of no stack, ``()``, is of threads that are not
        Python's, and what threads have used after their last look; the sampling itself is left out.
    """

    def __init__(self) -> None:
        self.seconds: Counter[Stack] = Counter()
        self._used: dict[int, float] = {}
        self._own = 0.0
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)

    def __enter__(self) -> Self:
        self._began = time.process_time()
        self._used = {thread.native_id or 0: _used_by(thread) for thread in threading.enumerate()}
        self._usual = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()
        sys.setswitchinterval(self._usual)
        self.seconds[()] += time.process_time() - self._began - self._own - self.seconds.total()

    def _sample(self) -> None:
        while not self._end.wait(INTERVAL):
            self._look()
            self._own = time.thread_time()

    def _look(self) -> None:
        frames = sys._current_frames()
        frames.pop(threading.get_ident())  # a cycle, which would keep the data of all other frames alive
        for thread in threading.enumerate():
            frame, number = frames.get(thread.ident or 0), thread.native_id or 0
            if frame is None or thread is self._thread:
                continue
            passed = (used := _used_by(thread)) - self._used.get(number, 0.0)
            self._used[number] = used
            if passed > 0.0:
                calls = []
                while frame is not None:
                    calls.append(_name(frame.f_code))
                    frame = frame.f_back
                self.seconds[tuple(reversed(calls))] += passed


def by_stage(seconds: Mapping[Stack, float], stages: Mapping[str, Sequence[str]]) -> Counter[str]:
    """Return the time of each stage and of all else: a stack belongs to the innermost call that is a stage's.

    Parameters
    ----------
    seconds : mapping of tuple of str to float
        Processor time by stack.
    stages : mapping of str to sequence of str
        The calls of each stage; a class stands for its methods, a function for those within it.
    """
    of_call = {call: stage for stage, calls in stages.items() for call in calls}

    @cache
    def stage_of(call: str) -> str | None:
        within = call.split(".")
        return next(
            (found for i in range(len(within), 0, -1) if (found := of_call.get(".".join(within[:i])))), None
        )

    found = Counter(dict.fromkeys((*stages, OTHER), 0.0))
    for stack, used in seconds.items():
        found[next((stage for call in reversed(stack) if (stage := stage_of(call))), OTHER)] += used
    return found


def collapsed(seconds: Mapping[Stack, float]) -> str:
    """Return stacks as flame graphs are drawn from: a line each, its calls and its milliseconds."""
    lines = ((";".join(stack) or "no stack", round(1e3 * used)) for stack, used in sorted(seconds.items()))
    return "".join(f"{calls} {milliseconds}\n" for calls, milliseconds in lines if milliseconds)


@cache
def _name(code: CodeType) -> str:
    path = code.co_filename.removesuffix(".py")
    for root in ("/vtkmuscle/", "/site-packages/"):
        path = path.rpartition(root)[2]
    return f"{path}:{code.co_qualname}"


def _used_by(thread: threading.Thread) -> float:
    """Return the processor time of a thread [s], 0 of one that has ended."""
    try:
        # The clock of a thread by its number, see include/linux/posix-timers.h of Linux.
        return time.clock_gettime((~(thread.native_id or 0) << 3) | 6)
    except OSError:
        return 0.0
