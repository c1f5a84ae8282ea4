"""The documentation's table of known gaps is complete."""

import runpy
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parents[1]
SCRIPT = TESTS.parent / "benchmarks" / "known_gaps.py"
#: Files with the word in another sense: sizes of the package, and this file.
NO_FIGURES = {"test_budget.py", Path(__file__).name}


@pytest.fixture(scope="module")
def known_gaps():
    return runpy.run_path(str(SCRIPT))


def test_the_table_has_a_row_for_each_mark(known_gaps):
    """After a change of marks: ``python benchmarks/known_gaps.py``."""
    assert known_gaps["TABLE"].read_text(encoding="utf-8") == known_gaps["table"](TESTS)


def test_no_test_is_expected_to_fail():
    """A bound that holds, with a mark of the gap, replaces an expected failure."""
    sources = {path: path.read_text(encoding="utf-8") for path in TESTS.rglob("*.py")}
    assert not [path for path, text in sources.items() if "xfail" in text and path.name not in NO_FIGURES]
