"""The test of an installation."""

import re

import pytest
from commands import vtkmuscle_

import vtkmuscle
from vtkmuscle import installation
from vtkmuscle.cli import Status


def test_an_installation_that_computes_otherwise_is_said(monkeypatch):
    """With a bound stricter than the method can be; the example in the docstring has the bound as it is."""
    monkeypatch.setattr(installation, "ARM_ERROR", 1e-3)
    assert vtkmuscle.selftest()["passed"].tolist() == [False, False, True, True, True]


def test_the_command_names_versions_and_fails_where_a_known_answer_is_missed(monkeypatch):
    rows = [("arm [mm]", 30.0, 32.0, 3.0, True), ("volume", 1.1, 1.0, 1e-6, False)]
    monkeypatch.setattr(installation, "selftest", lambda: vtkmuscle.Table(installation.COLUMNS, rows))
    done = vtkmuscle_("selftest", status=Status.FAILED)
    assert re.search(rf"^vtkmuscle +{re.escape(vtkmuscle.__version__)}$", done.output, re.MULTILINE)
    for word in ("python", "processors", "numba", "pictures", "kernels"):
        assert re.search(rf"^{word} +\S", done.output, re.MULTILINE)
    assert "passed  arm [mm]: 30, known 32, within 3" in done.output
    assert "FAILED  volume: 1.1, known 1, within 1e-06" in done.output


@pytest.mark.slow
def test_the_command_passes_here():
    assert vtkmuscle_("selftest").output.count("passed") == 5
