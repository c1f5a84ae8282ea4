"""The examples in docstrings and pages run, and give what they say."""

import doctest
import importlib
import warnings
from pathlib import Path

import pytest

import vtkmuscle

PACKAGE = Path(vtkmuscle.__file__).parent
DOCS = Path(__file__).parents[1] / "docs"
#: How many examples are written in each module.
MODULES = {
    ".".join(("vtkmuscle", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__"): count
    for path in sorted(PACKAGE.rglob("*.py"))
    if (count := path.read_text(encoding="utf-8").count(">>> "))
}
GENERATED = {"_build", "gallery", "generated"}
PAGES = sorted(
    path
    for path in DOCS.rglob("*.rst")
    if not GENERATED & set(path.parts) and ">>> " in path.read_text(encoding="utf-8")
)


def run(examples, tmp_path, monkeypatch):
    """Run examples in a folder of their own; a warning is an error."""
    monkeypatch.chdir(tmp_path)
    report = []
    runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for example in examples:
            runner.run(example, out=report.append)
    assert not report, "".join(report)


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_run(name, tmp_path, monkeypatch):
    examples = doctest.DocTestFinder(exclude_empty=True).find(importlib.import_module(name))
    # A filter's docstring is completed by its declarations; what it inherits is found where it is written.
    assert sum(len(example.examples) for example in examples) == MODULES[name], "an example is not found"
    run(examples, tmp_path, monkeypatch)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_the_examples_of_a_page_run(page, tmp_path, monkeypatch):
    text = page.read_text(encoding="utf-8")
    run([doctest.DocTestParser().get_doctest(text, {}, page.stem, str(page), 0)], tmp_path, monkeypatch)
