"""No page shows a table that today's defaults would not give."""

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def made(benchmarks):
    """The module that knows what tables were made with."""
    if not (ROOT / "docs").is_dir():
        pytest.skip("the documentation is not here")
    return importlib.import_module("made")


@pytest.fixture(scope="module")
def shown(made):
    """Names of the tables that pages show."""
    text = "\n".join(page.read_text(encoding="utf-8") for page in made.DOCS.rglob("*.rst"))
    table = r"(?:include::|:file:).*?((?:paper|how_right)_tables/\S+\.(?:txt|csv))"
    return {f"validation/{name}" for name in re.findall(table, text)}


def test_no_table_is_stale(made, shown):
    stale = {name: why for name in shown if (why := made.why_stale(made.DOCS / name))}
    assert not stale, "make them again: python benchmarks/remake.py --stale"


def test_every_table_can_be_made_again(made, shown):
    remake = importlib.import_module("remake")
    assert {str(table.relative_to(made.DOCS)) for table in made.tables()} >= shown
    assert all((ROOT / remake.command_of(table)[0]).is_file() for table in made.tables())
