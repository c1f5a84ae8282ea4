"""A cohort against independent processes: processor time for the same muscles, paired, in one run.

``python benchmarks/bench_cohort.py ATLAS --subjects 6``, where ATLAS is the folder of ``atlas.py``. Two
processes that run half of the scenes each, one after the other, and a study of the same scenes by two workers
of Dask, each with its start, its tables and its page. The ratio is that of their processor times, children's
included: what else the machine does is not in it.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ALONE = """
import sys
from vtkmuscle import Scene
for path in sys.argv[1:]:
    Scene.load(path).run(figures=False, workers=1)
"""


def processor_seconds(commands: list[list[str]]) -> float:
    """Return the processor time of commands that run side by side [s]."""
    before = os.times()
    running = [subprocess.Popen(command, stdout=subprocess.DEVNULL) for command in commands]
    for one in running:
        one.wait()
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def main() -> None:
    """Measure, and print."""
    asked = argparse.ArgumentParser(description=__doc__)
    asked.add_argument("atlas", type=Path)
    asked.add_argument("--subjects", type=int, default=6)
    options = asked.parse_args()
    with (options.atlas / "subjects.csv").open(newline="") as lines:
        rows = list(csv.reader(lines))
    there = [row for row in rows[1:] if (options.atlas / row[1] / "scene.toml").is_file()][: options.subjects]
    scenes = [str(options.atlas / row[1] / "scene.toml") for row in there]
    with tempfile.TemporaryDirectory() as folder:
        table = [",".join(rows[0][:2]), *(f"{row[0]},{(options.atlas / row[1]).absolute()}" for row in there)]
        Path(folder, "subjects.csv").write_text("\n".join(table) + "\n", encoding="utf-8")
        text = 'subjects = "subjects.csv"\nscene = "{folder}/scene.toml"\n'
        Path(folder, "study.toml").write_text(text, encoding="utf-8")
        python = [sys.executable, "-W", "ignore"]
        halves = [[*python, "-c", ALONE, *scenes[i::2]] for i in range(2)]
        study = [*python, "-m", "vtkmuscle", "cohort", f"{folder}/study.toml", "--quiet", "--workers", "2"]
        processor_seconds([[*python, "-c", ALONE, scenes[0]]])  # compiles what is not compiled
        alone = processor_seconds(halves)
        cohort = processor_seconds([[*study, "--out", f"{folder}/out"]])
    print(f"{len(scenes)} subjects: two processes {alone:.1f} s, a cohort {cohort:.1f} s of processor time")
    print(f"throughput of the cohort: {alone / cohort:.2f} of two independent processes")


if __name__ == "__main__":
    main()
