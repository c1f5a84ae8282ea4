"""Guard against regressions: ``python benchmarks/guard.py [--update] [--json FILE] [-k WORDS]``.

Runs the benchmarks of ``suite`` and compares them with ``guard.json`` beside this file, the last committed
result.

``ratios`` are times over that of a calibration kernel that this project will not change, measured in turns
with it: a slow machine slows both. One that grew by more than ``--margin`` (1.5) is a regression, and the
exit status 1. ``scaling`` are powers: how time grows with triangles, fibres, bones and frames (1 is in
proportion). ``counts`` do not depend on the machine at all (``work_counts.py``);
the tests hold them to the committed ones.
"""

from __future__ import annotations

import argparse
import json
import math
import platform
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))
from work_counts import counts

HERE = Path(__file__).resolve().parent
COMMITTED = HERE / "guard.json"
MARGIN = 1.5
#: A power of growth may be more than the committed one by this.
POWER_MARGIN = 0.25


def measured(*options: str) -> dict[str, Any]:
    """Run the suite; return the JSON of pytest-benchmark."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "result.json"
        command = [sys.executable, "-m", "pytest", HERE / "suite", "-q", "-n0", "--benchmark-only"]
        # The table goes to where it does not mix with the result.
        done = subprocess.run(
            [*command, f"--benchmark-json={path}", *options], stdout=sys.stderr, check=False
        )
        if done.returncode:
            raise SystemExit(f"the benchmarks failed, status {done.returncode}")
        result: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return result


def summary(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return ratios and growth from the JSON of pytest-benchmark."""
    ratios, sizes = {}, {}
    for row in result["benchmarks"]:
        about = row["extra_info"]
        name = row["fullname"].rpartition("/")[2].replace(".py::test_", ": ").removeprefix("test_")
        ratios[name] = float(f"{about['calibrations']:.4g}")
        if "scale" in about:
            sizes.setdefault(about["scale"], {})[about["size"]] = about["calibrations"]
    return {"ratios": ratios, "scaling": growth(sizes)}


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
    for name, power_now in now.get("scaling", {}).items():
        old = before.get("scaling", {}).get(name)
        if old is None:
            continue
        if power_now > old + POWER_MARGIN:
            worse.append(f"{name}: grows with the power {power_now:g}, was {old:g}")
    for name, count in now.get("counts", {}).items():
        old = before.get("counts", {}).get(name)
        slack = 1.25 if name.startswith("bytes") else 1.0
        if old is not None and count > slack * old:
            worse.append(f"{name}: {count}, was {old}")
    return worse


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, print, compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--update", action="store_true", help=f"write {COMMITTED.name}")
    parser.add_argument("--json", type=Path, help="write all of pytest-benchmark's result there, too")
    parser.add_argument("-k", metavar="WORDS", help="benchmarks that pytest chooses by these; no counts")
    parser.add_argument("--largest", type=int, default=100_000, help="most triangles of the scaling")
    parser.add_argument("--pypbd", metavar="PYTHON", help="a Python that has pypbd, to be compared with")
    parser.add_argument("--margin", type=float, default=MARGIN)
    asked = parser.parse_args(arguments)
    options = [f"--largest={asked.largest}"]
    options += [] if asked.k is None else ["-k", asked.k]
    options += [] if asked.pypbd is None else [f"--pypbd={asked.pypbd}"]
    raw = measured(*options)
    result = {"machine": f"{platform.machine()}, Python {platform.python_version()}", **summary(raw)}
    if asked.k is None:
        result["counts"] = counts()
    text = json.dumps(result, indent=2) + "\n"
    print(text)
    if asked.json is not None:
        asked.json.write_text(json.dumps(raw, indent=1) + "\n", encoding="utf-8")
    if asked.update:
        COMMITTED.write_text(text, encoding="utf-8")
        return
    worse = regressions(result, json.loads(COMMITTED.read_text(encoding="utf-8")), asked.margin)
    print("\n".join(worse) or "no regression", file=sys.stderr)
    raise SystemExit(bool(worse))


if __name__ == "__main__":
    main()
