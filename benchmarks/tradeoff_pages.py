"""Make the tables of docs/tradeoff.rst: ``python benchmarks/tradeoff_pages.py [--work FOLDER]``.

``vtkmuscle tradeoff`` is run with the presets on the phantom hip and on the real one, in steps of 10 degrees
over 90 degrees of flexion. There are numbers in the tables only, no pictures of the data set. All that was
run is kept in the work folder, and not run again until the code or the scene changes.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import time
from pathlib import Path

from muscle_problem import data_folder

DOCS = Path(__file__).resolve().parents[1] / "docs" / "tradeoff"
STEPS_OF_10 = ("--every", "5", "--frames", "0:10")
#: What the page shows.
SHOWN = "presets.rst"


def main() -> None:
    """Run the command, copy what the page shows."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--work", type=Path, default=Path("tradeoff_pages"), help="what is run is kept there")
    parser.add_argument("--docs", type=Path, default=DOCS, help="where tables and plots go")
    asked = parser.parse_args()
    for name, scene in (("phantom_hip", "demo"), ("lhdl_hip", data_folder() / "scene.toml")):
        begin, out = time.perf_counter(), asked.work / name
        command = [sys.executable, "-m", "vtkmuscle", "tradeoff", scene, *STEPS_OF_10, "--only", "presets"]
        subprocess.run([*map(str, command), "--out", str(out)], check=True)
        (asked.docs / name).mkdir(parents=True, exist_ok=True)
        shutil.copyfile(out / SHOWN, asked.docs / name / SHOWN)
        print(f"{name}: {time.perf_counter() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    main()
