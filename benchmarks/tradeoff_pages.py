"""Make the tables and plots of docs/tradeoff.rst: ``python benchmarks/tradeoff_pages.py [--work FOLDER]``.

``vtkmuscle tradeoff`` is run on the phantom hip and on the real one, in steps of 10 degrees over 90
degrees of flexion; with ``--all-frames`` also on the real one with the presets alone, in the 2 degree
steps of its motion. Tables and the plots that the page shows are copied to docs/tradeoff; there are
numbers in them only, no pictures of the data set. All that was run is kept in the work folder, and not
run again until the code or the scene changes.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from muscle_problem import data_folder

DOCS = Path(__file__).resolve().parents[1] / "docs" / "tradeoff"
STEPS_OF_10 = ("--every", "5", "--frames", "0:10")
#: What is varied.
GROUPS = ("presets", "iterations", "tolerance", "solver", "start")
#: What the page shows.
SHOWN = ("tradeoff.rst", "presets.rst", "pareto_rms_mm.svg", "pareto_fibre_length_mm.svg", "estimates.svg")
PRESETS_SHOWN = ("presets.rst", "estimates.svg")


def only(groups: Sequence[str]) -> list[str]:
    """Return the options that choose groups of settings."""
    return [word for group in groups for word in ("--only", group)]


def main() -> None:
    """Run the command, copy what the page shows."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, default=Path("tradeoff_pages"), help="what is run is kept there")
    parser.add_argument("--docs", type=Path, default=DOCS, help="where tables and plots go")
    parser.add_argument("--only", nargs="+", default=GROUPS, help="groups of settings")
    parser.add_argument("--all-frames", action="store_true", help="the presets in small steps, too")
    asked = parser.parse_args()
    chosen = only(asked.only)
    real = data_folder() / "scene.toml"
    pages = {
        "phantom_hip": (["demo", *STEPS_OF_10, *chosen], SHOWN),
        "lhdl_hip": ([str(real), *STEPS_OF_10, *chosen], SHOWN),
    }
    if asked.all_frames:
        every_frame = [str(real), "--frames", "0:46:5", *only(["presets"])]
        pages["lhdl_hip_all_frames"] = (every_frame, PRESETS_SHOWN)
    for name, (arguments, shown) in pages.items():
        begin, out = time.perf_counter(), asked.work / name
        command = [sys.executable, "-m", "vtkmuscle", "tradeoff", *arguments, "--out", out]
        subprocess.run([*map(str, command)], check=True)
        (asked.docs / name).mkdir(parents=True, exist_ok=True)
        for file in shown:
            shutil.copyfile(out / file, asked.docs / name / file)
        print(f"{name}: {time.perf_counter() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    main()
