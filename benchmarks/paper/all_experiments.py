"""All experiments of the two papers, one after the other: ``python benchmarks/paper/all_experiments.py``.

``--rst FOLDER`` writes each table for the documentation (docs/validation/paper_tables), where only numbers
go, no pictures of the data set.
"""

from __future__ import annotations

import argparse
import importlib
import time
from pathlib import Path

from common import case_of, case_options

EXPERIMENTS = (
    "kohout2021_fig3",
    "kohout2021_fig4_5",
    "kohout2021_fig6",
    "kohout2021_fig7",
    "kohout2021_fig8",
    "kohout2021_fig9",
    "kohout2021_fig10",
    "kohout2021_fig11",
    "kohout2021_fig12_15",
    "kohout2021_parameters",
    "kohout2021_times",
    "kohout2012_fig2",
    "kohout2012_fig4",
    "kohout2012_fig6",
    "kohout2012_fig8_9",
    "kohout2012_fig13_14",
    "kohout2012_time",
)


def main() -> None:
    """Run them."""
    parser = case_options(argparse.ArgumentParser(description=__doc__))
    parser.add_argument("--rst", type=Path, metavar="FOLDER", help="write tables for the documentation there")
    parser.add_argument("--only", nargs="+", choices=EXPERIMENTS, default=EXPERIMENTS)
    asked = parser.parse_args()
    case = case_of(asked)
    for name in asked.only:
        begin = time.perf_counter()
        tables = importlib.import_module(name).tables(case)
        for table in tables:
            print(table.text(), end="\n\n")
        print(f"({name}: {time.perf_counter() - begin:.0f} s)\n", flush=True)
        if asked.rst is not None:
            asked.rst.mkdir(parents=True, exist_ok=True)
            text = "\n".join(table.rst() for table in tables)
            (asked.rst / f"{name}.txt").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
