"""Each experiment of the papers runs on the phantom hip, in its short form, and shows what was published."""

import importlib
import re
from pathlib import Path

import pytest
from slow import slow

FOLDER = Path(__file__).parents[2] / "benchmarks" / "paper"
SCRIPTS = sorted(path.stem for path in FOLDER.glob("kohout*.py"))
#: Those that are quick even on the phantom; the others are run with ``-m study``.
QUICK = {
    "kohout2012_fig4",
    "kohout2012_fig6",
    "kohout2012_fig8_9",
    "kohout2021_fig4_5",
    "kohout2021_fig10",
    "kohout2021_fig11",
}


#: Of these, what takes seconds.
SLOW = {"kohout2021_fig11"}
#: Their tables, made by ``python benchmarks/remake.py --phantom``; what numbers in them may differ by between
#: machines, as a part and as a number.
TABLES = Path(__file__).parent / "phantom_tables"
NOISE, SMALL = 0.05, 0.02
REMAKE = "if that is meant to be: python benchmarks/remake.py --phantom, and --stale for the pages"


OTHERS = [name for name in SCRIPTS if name not in QUICK]


@pytest.fixture(scope="module")
def case(benchmarks):
    """The phantom hip, for all of them."""
    from common import Case

    return Case(real=False, short=True)


@pytest.mark.parametrize(
    "name", [*sorted(QUICK - SLOW), *slow(*SLOW), *(pytest.param(n, marks=pytest.mark.study) for n in OTHERS)]
)
def test_experiment_runs_on_the_phantom(name, case):
    tables = importlib.import_module(name).tables(case)
    for table in tables:
        assert table.rows
        assert table.text().count("\n") == len(table.rows) + 1
        assert table.rst().startswith(".. list-table:: ")
    assert any("published" in table.text() for table in tables)
    if name in QUICK:
        expected = (TABLES / f"{name}.txt").read_text(encoding="utf-8")
        found = "\n".join(table.rst() for table in tables)
        assert in_words(found) == in_words(expected), REMAKE
        for one, other in zip(numbers(found), numbers(expected), strict=True):
            assert abs(one - other) <= NOISE * max(abs(one), abs(other)) + SMALL, REMAKE


#: A number of a table.
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")


def in_words(text):
    """Return a table without its numbers."""
    return NUMBER.sub("#", text)


def numbers(text):
    """Return the numbers of a table."""
    return [float(found) for found in NUMBER.findall(text)]


def test_the_phantom_s_tables_are_those_of_the_quick_experiments(case):
    assert {path.stem for path in TABLES.glob("*.txt")} == QUICK


def test_the_command_line_knows_all_experiments(case):
    assert sorted(importlib.import_module("all_experiments").EXPERIMENTS) == SCRIPTS


def test_settings_of_the_paper_are_all_named(case):
    """A default that changes must not change what is called published."""
    from vtkmuscle.core.pbd.solver import PUBLISHED, Parameters

    assert Parameters(**PUBLISHED) == Parameters(
        iterations=10,
        prediction="velocity",
        signed_angles=False,
        order="kind",
        finish=False,
        dt=1.0,
        velocity_kept=0.99,
        stiffness=1.0,
        shape_stiffness=0.9,
        volume_stiffness=1.0,
        anisotropy="fibres",
        external_force=(0.0, 0.0, 0.0),
        bone_push="transform",
        contact_velocity="keep",
    )
