"""No page shows a table that today's defaults would not give, without saying so."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
#: What a page says of a table that has not been made again, right above it.
SAID = "Not made again"


@pytest.fixture(scope="module")
def made(benchmarks):
    """The module that knows what tables were made with."""
    if not (ROOT / "docs").is_dir():
        pytest.skip("the documentation is not here")
    return importlib.import_module("made")


def shown_above(docs):
    """Return for each table that a page shows what stands right above it."""
    shown = {}
    for page in docs.rglob("*.rst"):
        lines = page.read_text(encoding="utf-8").splitlines()
        for number, line in enumerate(lines):
            found = re.search(r"((?:paper|how_right)_tables/\S+\.(?:txt|csv))", line)
            if found and ("include::" in line or ":file:" in line):
                shown[f"validation/{found[1]}"] = " ".join(lines[max(number - 6, 0) : number])
    return shown


def test_stale_tables_are_said_to_be(made):
    shown = shown_above(made.DOCS)
    stale = {
        name: why
        for name, above in shown.items()
        if (why := made.why_stale(made.DOCS / name)) and SAID not in above
    }
    assert not stale, "make them again: python benchmarks/remake.py --stale"


def test_what_is_of_today_is_not_said_to_be_stale(made):
    shown = shown_above(made.DOCS)
    assert not [
        name for name, above in shown.items() if SAID in above and not made.why_stale(made.DOCS / name)
    ]


def test_every_table_is_shown_and_can_be_made_again(made):
    remake = importlib.import_module("remake")
    names = {str(table.relative_to(made.DOCS)) for table in made.tables()}
    assert names >= set(shown_above(made.DOCS))
    assert all((ROOT / remake.command_of(table)[0]).is_file() for table in made.tables())


@pytest.mark.parametrize("what", ["default", "preset", "script", "table"])
def test_a_change_of_what_a_table_was_made_with_is_seen(made, monkeypatch, tmp_path, what):
    table = tmp_path / "kohout2021_fig3.txt"
    table.write_text("a table")
    script = tmp_path / "script.py"
    script.write_text("print(1)")
    monkeypatch.setattr(made, "scripts_of", lambda _: [script])
    made.note(table, "python script.py")
    assert made.why_stale(table) == ""
    if what == "default":
        monkeypatch.setattr(made.filters.PBDDeformer.parameter_declarations["iterations"], "default", 31)
    elif what == "preset":
        monkeypatch.setattr(made, "PRESETS", {**made.PRESETS, "preview": {"iterations": 31}})
    elif what == "script":
        script.write_text("print(2)")
    else:
        table.write_text("another table")
    assert made.why_stale(table)
