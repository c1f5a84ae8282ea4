"""Make the generated tables of the documentation again: ``python benchmarks/remake.py``.

``--list`` says which are stale, and why; ``--stale`` makes those only. Tables of the real hip and knee need
``VTKMUSCLE_DATA``, the folder that holds ``lhdl_hip`` and ``bp3d_knee``. ``--phantom`` makes the small tables
of the phantom hip that the tests compare with (``tests/benchmarks/phantom_tables``).
"""

from __future__ import annotations

import argparse
import shlex
import subprocess
import sys
from pathlib import Path

import made
from real_hip import data_folder

ROOT = made.HERE.parent
PHANTOM = ROOT / "tests" / "benchmarks" / "phantom_tables"


def command_of(table: Path) -> list[str]:
    """Return the arguments of Python that make a table, and those that it makes beside it."""
    if table.parent == made.PAPER:
        script = "benchmarks/paper/all_experiments.py"
        return [script, "--data", "real", "--only", table.stem, "--rst", "docs/validation/paper_tables"]
    script = made.SCRIPTS.get(table.stem, "how_right.py")
    how = [f"benchmarks/{script}", "--rst", f"docs/{table.parent.relative_to(made.DOCS)}"]
    if table.name in ("hip.csv", "knee.csv"):
        folder = data_folder() if table.name == "hip.csv" else data_folder().with_name("bp3d_knee")
        return [*how, f"--{table.stem}", str(folder)]
    return how


def shown(arguments: list[str]) -> str:
    """Return a command as a reader can give it: the folder of the data is theirs."""
    folders = {str(data_folder()), str(data_folder().with_name("bp3d_knee"))}
    return shlex.join(["python", *("FOLDER" if word in folders else word for word in arguments)])


def remake(tables: list[Path]) -> None:
    """Make tables again, each command once."""
    commands = {tuple(command_of(table)): None for table in tables}
    for command in commands:
        print(shown(list(command)), flush=True)
        subprocess.run([sys.executable, *command], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
        for table in made.tables():
            if tuple(command_of(table)) == command:
                made.note(table, shown(list(command)))


def main() -> None:
    """Do what the options say."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--list", action="store_true", help="say which tables are stale, and why")
    parser.add_argument("--stale", action="store_true", help="make the stale ones only")
    parser.add_argument("--only", nargs="+", metavar="NAME", help="tables by the names of their files")
    parser.add_argument("--phantom", action="store_true", help="the phantom's tables of the tests instead")
    asked = parser.parse_args()
    if asked.phantom:
        script = [sys.executable, "benchmarks/paper/all_experiments.py", "--data", "phantom", "--short"]
        names = [path.stem for path in PHANTOM.glob("*.txt")]
        subprocess.run([*script, "--rst", str(PHANTOM), "--only", *names], cwd=ROOT, check=True)
        return
    tables = [table for table in made.tables() if asked.only is None or table.stem in asked.only]
    if asked.list:
        for table in tables:
            print(f"{table.relative_to(made.DOCS)}: {made.why_stale(table) or 'of today'}")
        return
    remake([table for table in tables if not asked.stale or made.why_stale(table)])


if __name__ == "__main__":
    main()
