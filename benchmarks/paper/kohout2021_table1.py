"""Kohout and Červenka 2021, Table 1: time of a step against iterations.

A step is all of Algorithm 2: bones, muscle, collision and fibres. Medians over steps of 2 degrees. Published
times are of an i7-7700K; beside them are those of the authors' published code (C++, -O3, one core), measured
on a machine like the one that ours were measured on.
"""

from __future__ import annotations

import numpy as np
from common import AS_PUBLISHED, Case, Table, angles_up_to, main

PUBLISHED = {1: 53.04, 3: 62.55, 5: 74.66, 10: 104.96, 25: 193.66, 50: 441.72, 100: 658.71}
THEIR_CODE = {1: 6.9, 3: 18.0, 5: 28.6, 10: 57.3, 25: 137.0, 50: 275.0, 100: 544.0}


def tables(case: Case) -> list[Table]:
    """Return the times, with the published settings and the defaults."""
    columns = (
        "iterations",
        "published",
        "their code",
        "as published, here",
        "defaults, as many rounds",
        "their code / defaults",
    )
    table = Table(f"Table 1: ms of processor time per step, {case.adductor}", columns)
    for count in (1, 3) if case.short else PUBLISHED:
        angles = angles_up_to(6.0 if case.short else 16.0)
        ours = [
            np.median(case.chain(case.adductor, iterations=count, **settings).step_times(angles))
            for settings in (AS_PUBLISHED, {})
        ]
        theirs = THEIR_CODE[count] if case.real else ""
        ratio = f"{THEIR_CODE[count] / ours[1]:.2f}" if case.real else ""
        table.add(count, PUBLISHED[count], theirs, *(f"{ms:.1f}" for ms in ours), ratio)
    return [table]


if __name__ == "__main__":
    main(__doc__, tables)
