"""Guard against regressions: ``python benchmarks/guard.py [--update]``, against ``guard.json`` beside it.

``counts`` do not depend on the machine: what a run does how often (``work_counts.py``), how much the kernels
of a decomposition and of a transport are given (``fibre_counts.py``). The latter may grow by 3 %, so may
triangles drawn, bytes and steps of paths by a quarter, and what a run does not at all. The tests hold them
to the committed.

``ratios`` are times of processor over that of a calibration kernel that this project will not change, taken
in turns with it: medians of the turns. On two processors with six processes at work, eight runs differed from
their middle by up to 12 % (settling) and 5 % (the others). So 15 % more is a regression (``--margin``); the
tests, which may run on another kind of processor, allow twice as much.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from calibration import TRIANGLES, calibration
from fibre_counts import OF_FIBRES, fibre_work
from problems import settling_of, steps_of
from work_counts import counts

from vtkmuscle import phantoms
from vtkmuscle.core.fibres.embedding import sparse_mean_value_coordinates
from vtkmuscle.data.arrays import checked_surface, points_of
from vtkmuscle.filters import FibreTransport, FixedPointDetector
from vtkmuscle.pipelines import decompose

HERE = Path(__file__).resolve().parent
COMMITTED = HERE / "guard.json"
MARGIN, TURNS = 1.15, 9


def figures() -> dict[str, Callable[[], object]]:
    """Return what is timed, by name."""
    phantom = phantoms.spindle_over_hinge()
    ((name, muscle),) = phantom.muscles.items()
    areas = phantom.attachments[name]
    marked = FixedPointDetector()(muscle, phantom.bones, areas)
    fibres = decompose(muscle, areas, n_fibres=100, resolution=15).update().output
    transport = FibreTransport()

    def transported() -> object:
        transport.Modified()
        return transport(fibres, marked, muscle)

    points, triangles = checked_surface(muscle, "guard")
    places = points_of(fibres)

    return {
        "settling": settling_of(TRIANGLES),
        "step": steps_of(TRIANGLES),
        "transport": transported,
        "weights": lambda: sparse_mean_value_coordinates(points, triangles, places, prune=0.3),
        "decomposition": lambda: decompose(muscle, areas, n_fibres=100, resolution=15).update(),
    }


def ratios(turns: int = TURNS) -> dict[str, float]:
    """Return the time of each figure in calibrations: the median of some turns after a first one."""
    runs, calibrate = figures(), calibration()
    taken: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(turns + 1):
        for name, run in runs.items():
            taken[name].append(_seconds(run) / _seconds(calibrate))
    return {name: float(f"{np.median(values[1:]):.4g}") for name, values in taken.items()}


def _seconds(run: Callable[[], object]) -> float:
    begin = time.process_time()
    run()
    return time.process_time() - begin


def growth(sizes: Mapping[str, Mapping[int, float]]) -> dict[str, float]:
    """Return how time grows between the ends of each scale: a power."""
    found = {}
    for scale, times in sizes.items():
        if len(times) < 2:
            continue
        low, high = min(times), max(times)
        power = math.log(times[high] / times[low]) / math.log(high / low)
        found[f"{scale}, {low} to {high}"] = round(power, 3)
    return found


def regressions(now: Mapping[str, Any], before: Mapping[str, Any], margin: float = MARGIN) -> list[str]:
    """Return what got worse, in words; what only one of the two has is left out."""
    worse = []
    for name, ratio in now.get("ratios", {}).items():
        old = before.get("ratios", {}).get(name)
        if old is not None and ratio > margin * old:
            worse.append(f"{name}: {ratio:g} calibrations, was {old:g} ({ratio / old:.2f} times)")
    for name, count in now.get("counts", {}).items():
        old = before.get("counts", {}).get(name)
        slack = 1.25 if name.startswith(("bytes", "steps")) else 1.0
        if name == "triangles drawn" or name.endswith(OF_FIBRES):
            slack = 1.03
        if old is not None and count > slack * old:
            worse.append(f"{name}: {count}, was {old}")
    return worse


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print, compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--update", action="store_true", help=f"write {COMMITTED.name}")
    parser.add_argument("--margin", type=float, default=MARGIN, help="of ratios")
    asked = parser.parse_args(arguments)
    result = {
        "machine": f"{platform.machine()}, Python {platform.python_version()}",
        "ratios": ratios(),
        "counts": {**counts(), **fibre_work()},
    }
    text = json.dumps(result, indent=2) + "\n"
    print(text)
    if asked.update:
        COMMITTED.write_text(text, encoding="utf-8")
        return
    worse = regressions(result, json.loads(COMMITTED.read_text(encoding="utf-8")), asked.margin)
    print("\n".join(worse) or "no regression", file=sys.stderr)
    raise SystemExit(bool(worse))


if __name__ == "__main__":
    main()
