"""Times that can be compared on a machine that does other things as well."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np


def interleaved(
    variants: Mapping[str, Callable[[], object]],
    *,
    rounds: int,
    clock: Callable[[], float] = time.perf_counter,
) -> dict[str, float]:
    """Return the least time of each variant [ms].

    They take turns, so that whatever else the machine does falls on all of them. The first round, in which
    things are compiled and caches filled, does not count. What runs in this thread alone may be timed by
    ``time.thread_time``, which does not count what others take of the processor.
    """
    best = dict.fromkeys(variants, np.inf)
    for turn in range(rounds + 1):
        for name, run in variants.items():
            start = clock()
            run()
            if turn:
                best[name] = min(best[name], clock() - start)
    return {name: 1e3 * seconds for name, seconds in best.items()}
