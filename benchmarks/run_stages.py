"""Where the processor time of a run goes, by stage: ``python benchmarks/run_stages.py [SCENE]``.

The run is as ``vtkmuscle run --workers 1`` makes it, with all outputs and from the start of Python on; of the
real hip, unless another scene is given. The first one may compile: run it twice. Times are of the processor,
of all threads and of the process that draws. ``--stacks FILE`` writes them by stacks of calls, from which any
flame graph is drawn; ``--write`` writes the table of the documentation.
"""

from __future__ import annotations

import argparse
import csv
import resource
import tempfile
import time
from collections import Counter
from pathlib import Path

from real_hip import data_folder
from sampling import Sampling, Stack, by_stage, collapsed

TABLE = Path(__file__).resolve().parents[1] / "docs/explanation/cost_tables/run.csv"
#: What is in no stack: Python before it samples, and processes that it has started.
_START, _CHILDREN = "start of Python", "other processes"

#: The calls that a stage is. What they call belongs to it, but for calls of another stage.
STAGES: dict[str, tuple[str, ...]] = {
    "import": (_START, "<frozen importlib._bootstrap>:_find_and_load"),
    "reading": ("scenes:Scene.load", "scene/sense:check_sense", "run/store/writing:ResultWriter.__init__"),
    "fields": ("core/bones/bone:Bone.fill", "core/mesh/solids:solids_of"),
    "filling": ("run/muscles:MuscleRun.go",),
    "steps": ("run/muscles:MuscleRun._compute",),
    "fibres": (
        "filters/path_deformer:PathDeformer._fibres",
        "filters/fibre_transport:FibreTransport",
        "filters/fibre_metrics:FibreMetrics",
        "core/fibres/mean_value:weights_of",  # threads of their own, whose stacks begin with it
    ),
    "measuring": (
        "run/measure:MuscleMeasure",
        "run/muscles:MuscleRun._judge",
        "run/muscles:_add_penetration",
        "run/report_values:architecture_of",
        "run/report_values:fibres_at_rest",
        "run/report_values:measures_of_fibres",
    ),
    "tables": ("run/steps:_judge_further", "run/store/writing:ResultWriter.write_tables", "run/table:Table"),
    "frames": ("run/muscles:MuscleRun._keep", "run/store/writing:ResultWriter"),
    "figures": (_CHILDREN, "run/figures:Drawing"),
    "page": ("report/page:page_of",),
}


def run_seconds(scene: Path, out: Path, *, figures: bool = True) -> Counter[Stack]:
    """Run a scene into a folder, and return the processor time by stack [s]."""
    start, children = time.process_time(), _of_children()
    with Sampling() as sampling:
        from vtkmuscle import Scene  # importing is a stage

        Scene.load(scene).run(out, figures=figures, workers=1)
    return sampling.seconds + Counter({(_START,): start, (_CHILDREN,): _of_children() - children})


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def rows(seconds: Counter[Stack]) -> list[list[str]]:
    """Return the table: seconds and share of each stage, and the total."""
    found, whole = by_stage(seconds, STAGES), seconds.total()
    return [
        [stage, f"{used:.1f}", f"{100.0 * used / whole:.0f}"]
        for stage, used in [*found.items(), ("total", whole)]
    ]


def print_table(seconds: Counter[Stack]) -> None:
    """Print it."""
    for stage, used, share in rows(seconds):
        print(f"{stage:12}{used:>8} s{share:>5} %")


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("scene", nargs="?", type=Path, help="a scene.toml; default the real hip")
    parser.add_argument("--no-figures", action="store_true")
    parser.add_argument("--stacks", type=Path, metavar="FILE", help="write the time by stack of calls")
    parser.add_argument("--write", action="store_true", help=f"write {TABLE.name} of the documentation")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        scene = asked.scene or data_folder() / "scene.toml"
        seconds = run_seconds(scene, Path(folder) / "out", figures=not asked.no_figures)
    print_table(seconds)
    if asked.stacks is not None:
        asked.stacks.write_text(collapsed(seconds), encoding="utf-8")
    if asked.write:
        TABLE.parent.mkdir(exist_ok=True)
        with TABLE.open("w", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows(
                [["stage", "processor time [s]", "share [%]"], *rows(seconds)]
            )


if __name__ == "__main__":
    main()
