"""Write the documentation's table of known gaps: ``python benchmarks/known_gaps.py``.

A gap is a wanted figure that does not hold. The test of the quantity has a weaker bound, and the mark
``pytest.mark.gap(quantity, today, wanted)``. The table has a row per mark, with the command of the
tests in the file.
"""

from __future__ import annotations

import ast
import csv
import io
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "docs" / "validation" / "known_gaps.csv"
HEADER = ("quantity", "today", "wanted", "command")


def gaps(tests: Path) -> Iterator[tuple[str, str, str, str]]:
    """Yield quantity, today's figure, wanted figure and command of each mark in a folder of tests."""
    for path in sorted(tests.rglob("test_*.py")):
        command = f"``pytest -m gap {path.relative_to(tests.parent).as_posix()}``"
        for test in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(test, ast.FunctionDef):
                for mark in test.decorator_list:
                    if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.gap":
                        quantity, today, wanted = map(ast.literal_eval, mark.args)
                        yield quantity, today, wanted, command


def table(tests: Path) -> str:
    """Return the table of a folder of tests as CSV."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([HEADER, *gaps(tests)])
    return text.getvalue()


if __name__ == "__main__":
    TABLE.write_text(table(ROOT / "tests"), encoding="utf-8")
