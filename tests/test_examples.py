"""Each script in examples/ is short, and runs off-screen in a process of its own.

The documentation runs each of them too, with warnings as errors; so here they run in the long form only.
"""

import os
from pathlib import Path

import pytest
from commands import python

import vtkmuscle

#: Where the package is, installed or not.
PACKAGES = Path(vtkmuscle.__file__).parents[1]
EXAMPLES = sorted((Path(__file__).parents[1] / "examples").rglob("plot_*.py"))
LONGEST = 60  # lines


def test_there_are_examples():
    assert len(EXAMPLES) >= 4


@pytest.mark.long
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(example, tmp_path, renders):
    here = {"PYVISTA_OFF_SCREEN": "true", "PYTHONPATH": str(PACKAGES), "MPLBACKEND": "agg"}
    done = python("-W", "error", example, cwd=tmp_path, env={**os.environ, **here})
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_is_short(example):
    assert len(example.read_text(encoding="utf-8").splitlines()) <= LONGEST
