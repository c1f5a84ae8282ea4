"""All experiments of the two papers, one after the other: ``python benchmarks/paper/all_experiments.py``.

``--rst FOLDER`` writes each table for the documentation (docs/paper_tables), where only numbers go, no
pictures of the data set.
"""

from __future__ import annotations

import argparse
import importlib
import time
from pathlib import Path

from common import case_of, case_options

EXPERIMENTS = (
    "p21_fig3",
    "p21_fig4_5",
    "p21_fig7",
    "p21_table1",
    "p21_fig8",
    "p21_fig9",
    "p21_fig10",
    "p21_fig11",
    "p21_fig12_14",
    "p21_table2",
    "p21_fig15",
    "p12_fig2",
    "p12_fig4",
    "p12_fig6",
    "p12_fig8_9",
    "p12_fig13_14",
    "p12_time",
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
