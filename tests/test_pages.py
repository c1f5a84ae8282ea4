"""The code blocks of the documentation's pages run, in order, and give what the pages say."""

import importlib
import re
import sys
import warnings
from pathlib import Path

import pytest

from vtkmuscle.plotting import can_render

DOCS = Path(__file__).parents[1] / "docs"
GENERATED = {"_build", "gallery", "generated", "pictures"}
PAGES = [path for path in sorted(DOCS.rglob("*.rst")) if not GENERATED & set(path.parts)]
CODE = re.compile(r"^\s*(?:\.\. code-block:: (?:python|console|toml)|>>> )", flags=re.MULTILINE)
WITH_CODE = [path for path in PAGES if CODE.search(path.read_text(encoding="utf-8"))]
#: The documentation's build runs it too, for its pictures.
RUN_BY_THE_BUILD = DOCS / "start" / "first_scene.rst"


@pytest.fixture(scope="module")
def page_examples():
    """The module that runs pages; it is beside the documentation, for its build runs them too."""
    pytest.importorskip("sybil", reason="sybil is not installed")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(DOCS / "_ext"), *sys.path])
        yield importlib.import_module("page_examples")


@pytest.mark.parametrize(
    "page",
    [pytest.param(path, marks=[pytest.mark.long] * (path == RUN_BY_THE_BUILD)) for path in WITH_CODE],
    ids=lambda path: path.stem,
)
def test_the_code_of_a_page_runs(page, page_examples, tmp_path, monkeypatch):
    if can_render() is not None and "plot(" in page.read_text(encoding="utf-8"):
        pytest.skip(can_render())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("pyvista.OFF_SCREEN", True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        page_examples.run_page(page)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_code_that_no_test_runs_says_why(page):
    """Blocks of languages that are not run are text; one that is skipped has a reason."""
    text = page.read_text(encoding="utf-8")
    languages = set(re.findall(r"^\s*\.\. code-block:: *(\S*)", text, flags=re.MULTILINE))
    assert languages <= {"python", "console", "toml", "text"}
    for skip in re.findall(r"^\.\. skip: (.*)$", text, flags=re.MULTILINE):
        assert re.fullmatch(r'(?:next|start) "[^"]{8,}"|end', skip), skip


#: What somebody writes to fill in later.
LATER = re.compile(r"\b(?:KNOWN|TODO|FIXME|TBD|XXX|Lorem)\b|\?\?\?|Not made again")


def test_no_page_has_a_placeholder():
    found = [
        f"{page.name}:{number}"
        for page in PAGES
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1)
        if LATER.search(line)
    ]
    assert not found
