"""Times that can be compared on a machine that does other things as well."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np


def interleaved(variants: Mapping[str, Callable[[], object]], *, rounds: int) -> dict[str, float]:
    """Return the least time of each variant [ms].

    They take turns, so that whatever else the machine does falls on all of them. The first round, in which
    things are compiled and caches filled, does not count.
    """
    best = dict.fromkeys(variants, np.inf)
    for turn in range(rounds + 1):
        for name, run in variants.items():
            start = time.perf_counter()
            run()
            if turn:
                best[name] = min(best[name], time.perf_counter() - start)
    return {name: 1e3 * seconds for name, seconds in best.items()}
