"""Make the tables of docs/tradeoff.rst: ``python benchmarks/tradeoff_pages.py [--work FOLDER]``.

``vtkmuscle tradeoff`` is run with the presets on the phantom hip and on the real one, in steps of 10 degrees
over 90 degrees of flexion. There are numbers in the tables only, no pictures of the data set. All that was
run is kept in the work folder, and not run again until the code or the scene changes.
"""

from __future__ import annotations

import argparse
import csv
import subprocess
import sys
import time
from pathlib import Path

from muscle_problem import data_folder

DOCS = Path(__file__).resolve().parents[1] / "docs" / "tradeoff"
STEPS_OF_10 = ("--every", "5", "--frames", "0:10")
#: Columns that the page shows, and their headings.
SHOWN = {
    "setting": "preset",
    "muscle": "muscle",
    "ms_per_frame": "ms per step",
    "rms_mm": "RMS distance [mm]",
    "max_mm": "greatest distance [mm]",
    "volume_error_pct": "volume error [%]",
    "penetration_p95_mm": "depth in bones, p95 [mm]",
    "penetration_max_mm": "greatest depth [mm]",
    "fibre_length_mm": "error of the mean fibre length [mm]",
}


def write_presets(out: Path, path: Path) -> None:
    """Write the table of a study's presets as the page shows it, muscle by muscle and all together."""
    with (out / "tradeoff.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    names = list(dict.fromkeys(row["setting"] for row in rows))
    rows.sort(key=lambda row: (names.index(row["setting"]), row["muscle"] == "all"))
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(SHOWN.values())
        writer.writerows([_short(row[name]) for name in SHOWN] for row in rows)


def _short(cell: str) -> str:
    try:
        value = float(cell)
    except ValueError:
        return cell
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"


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
        write_presets(out, asked.docs / name / "presets.csv")
        print(f"{name}: {time.perf_counter() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    main()
