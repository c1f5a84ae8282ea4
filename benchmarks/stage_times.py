"""Processor time of each filter of a chain: within ``execute``, and what the filter adds to it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.filters.base.running import upstream

#: What a filter may add to its kernels in a frame [ms].
MOST_ADDED = 1.0


class StageTimes:
    """Clocks on the filters of a chain, of this thread.

    Parameters
    ----------
    last : Filter
        The end of the chain.

    Attributes
    ----------
    stages : list of Filter
        The filters that run in a frame, in their order.
    """

    def __init__(self, last: Filter) -> None:
        self._last = last
        self.stages = [each for each in reversed(list(upstream(last))) if isinstance(each, Filter)]
        self._spent = np.zeros((len(self.stages), 2))
        #: Time of calls within each call that is running.
        self._within: list[float] = []
        for number, stage in enumerate(self.stages):
            for column, name in enumerate(("execute", "ProcessRequest")):
                setattr(stage, name, self._clocked(number, column, getattr(stage, name)))

    def _clocked(self, number: int, column: int, function: Callable[..., Any]) -> Callable[..., Any]:
        def clocked(*arguments: Any) -> Any:
            began = time.thread_time()
            self._within.append(0.0)
            try:
                return function(*arguments)
            finally:
                taken = time.thread_time() - began
                self._spent[number, column] += taken - self._within.pop()
                if self._within:
                    self._within[-1] += taken

        return clocked

    def measure(self, times: Sequence[float], rounds: int) -> np.ndarray:
        """Return kernels and additions of the stages (n, 2), the median frame of each one's least [ms].

        What VTK and ``update()`` take outside of the filters counts in equal parts as added by each of the
        stages that run; a stage that does not run in a frame has zeros. The first time is not measured.
        """
        least = np.full((len(times) - 1, len(self.stages), 2), np.inf)
        for _ in range(rounds):
            self._last.update(time=times[0])
            for best, now in zip(least, times[1:], strict=True):
                self._spent[:] = 0.0
                began = time.thread_time()
                self._last.update(time=now)
                whole = time.thread_time() - began
                runs = self._spent[:, 0] > 0.0
                self._spent[runs, 1] += (whole - self._spent.sum()) / runs.sum()
                np.minimum(best, 1e3 * self._spent, out=best)
        return np.median(least, axis=0)

    def report(self, times: Sequence[float], rounds: int) -> None:
        """Measure and print a table, of the stages that run."""
        measured = self.measure(times, rounds)
        print(f"  {'stage, ms':28s} {'kernels':>8s} {'added':>8s}")
        for stage, (kernels, added) in zip(self.stages, measured, strict=True):
            if kernels > 0.0:
                print(f"  {type(stage).__name__:28s} {kernels:8.2f} {added:8.2f}")
        print(f"  (most added: {measured[:, 1].max():.2f}; bound: {MOST_ADDED:g})")
