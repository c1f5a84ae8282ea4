"""Make the tables and plots of docs/tradeoff.rst: ``python benchmarks/tradeoff_pages.py [--work FOLDER]``.

``vtkmuscle tradeoff`` is run on the phantom hip and on the real one, in steps of 10 degrees over 90
degrees of flexion; with ``--all-frames`` also on the real one with the presets alone, in the 2 degree
steps of its motion. Tables and the plots that the page shows are copied to docs/tradeoff; there are
numbers in them only, no pictures of the data set. All that was run is kept in the work folder, and not
run again until the code or the scene changes.
"""

from __future__ import annotations

import argparse
import csv
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
GROUPS = ("presets", "iterations", "tolerance", "solver", "prediction")
#: Plots that the page shows.
SHOWN = ("pareto_rms_mm.svg", "pareto_fibre_length_mm.svg", "estimates.svg")
#: Columns of the table of the presets, and their headings.
OF_PRESETS = {
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


def only(groups: Sequence[str]) -> list[str]:
    """Return the options that choose groups of settings."""
    return [word for group in groups for word in ("--only", group)]


def tables(out: Path, docs: Path) -> None:
    """Write the tables of a study as the page shows them, and its remarks."""
    with (out / "tradeoff.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    together = [row for row in rows if row["muscle"] == "all"]
    names = [name for name in rows[0] if name not in ("muscle", "group")]
    presets = [row for row in rows if row["group"] in ("presets", "reference")]
    presets.sort(key=lambda row: [own["setting"] for own in together].index(row["setting"]))
    _write(docs / "settings.csv", dict(zip(names, names, strict=True)), together)
    _write(docs / "presets.csv", OF_PRESETS, presets)
    remarks, _, _ = (out / "tradeoff.md").read_text(encoding="utf-8").partition("\n|")
    lines = [line for line in remarks.splitlines() if line.startswith("- ")]
    (docs / "remarks.rst").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write(path: Path, columns: dict[str, str], rows: Sequence[dict[str, str]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns.values())
        writer.writerows([_short(row[name]) for name in columns] for row in rows)


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
    parser.add_argument("--only", nargs="+", default=GROUPS, help="groups of settings")
    parser.add_argument("--all-frames", action="store_true", help="the presets in small steps, too")
    asked = parser.parse_args()
    chosen = only(asked.only)
    real = data_folder() / "scene.toml"
    pages = {
        "phantom_hip": ["demo", *STEPS_OF_10, *chosen],
        "lhdl_hip": [str(real), *STEPS_OF_10, *chosen],
    }
    if asked.all_frames:
        pages["lhdl_hip_all_frames"] = [str(real), "--frames", "0:46:5", *only(["presets"])]
    for name, arguments in pages.items():
        begin, out = time.perf_counter(), asked.work / name
        command = [sys.executable, "-m", "vtkmuscle", "tradeoff", *arguments, "--out", out]
        subprocess.run([*map(str, command)], check=True)
        (asked.docs / name).mkdir(parents=True, exist_ok=True)
        tables(out, asked.docs / name)
        for file in SHOWN:
            shutil.copyfile(out / file, asked.docs / name / file)
        print(f"{name}: {time.perf_counter() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    main()
