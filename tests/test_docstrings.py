"""The examples in docstrings run, and give what they say."""

import doctest
import importlib
import warnings
from pathlib import Path

import pytest

import vtkmuscle

PACKAGE = Path(vtkmuscle.__file__).parent
#: How many examples are written in each module.
MODULES = {
    ".".join(("vtkmuscle", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__"): count
    for path in sorted(PACKAGE.rglob("*.py"))
    if (count := path.read_text(encoding="utf-8").count(">>> "))
}


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
