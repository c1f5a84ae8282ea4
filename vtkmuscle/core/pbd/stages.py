"""What a step spends its time on."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import MappingProxyType

#: Stages of a step, in order; time that belongs to none of them is not counted.
STAGES = ("prediction", "constraints", "collision", "acceleration", "settling")


class StageClock:
    """Adds up the time of each stage; there is always exactly one, so that no time counts twice.

    Parameters
    ----------
    stage : str
        The first of :data:`STAGES`.

    Examples
    --------
    >>> from vtkmuscle.core.pbd.stages import StageClock
    >>> clock = StageClock("constraints")
    >>> before = clock.switch("collision")
    >>> before, clock.switch(before)
    ('constraints', 'collision')
    >>> [stage for stage, spent in clock.stop().items() if spent > 0]
    ['constraints', 'collision']
    """

    def __init__(self, stage: str) -> None:
        self._spent = dict.fromkeys(STAGES, 0.0)
        self._stage = stage
        self._since = time.perf_counter()

    def switch(self, stage: str) -> str:
        """Begin another stage, one of :data:`STAGES`, and return the one that ended."""
        ended, now = self._stage, time.perf_counter()
        self._spent[ended] += now - self._since
        self._stage, self._since = stage, now
        return ended

    def stop(self) -> Mapping[str, float]:
        """Return the time of each stage so far [ms]."""
        self.switch(self._stage)
        return MappingProxyType({stage: 1e3 * spent for stage, spent in self._spent.items()})


def add_stages(*measured: Mapping[str, float]) -> Mapping[str, float]:
    """Return the sum of measurements [ms]."""
    return MappingProxyType({stage: sum(one.get(stage, 0.0) for one in measured) for stage in STAGES})
