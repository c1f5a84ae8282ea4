"""DESIGN's contract, over all filters that there are: a new filter is under test the moment it exists."""

import re
from pathlib import Path

import contract
import pytest
from filter_case import Case

import vtkmuscle.filters

FILTERS = vtkmuscle.filters.filter_classes()
every_filter = pytest.mark.parametrize("kind", FILTERS, ids=lambda kind: kind.__name__)


def test_filters_are_found():
    assert {"FibreSmoother", "BoneMotion"} <= {kind.__name__ for kind in FILTERS}


def test_every_filter_in_the_package_is_public():
    written = {
        name
        for file in Path(vtkmuscle.filters.__path__[0]).rglob("*.py")
        for name in re.findall(
            r"^class (\w+)\(.*\b(?:Filter|HistoryFilter\[\w+\])\)",
            file.read_text(encoding="utf-8"),
            re.MULTILINE,
        )
    }
    assert written == {kind.__name__ for kind in FILTERS}
    assert written < set(vtkmuscle.filters.__all__)


@every_filter
@pytest.mark.parametrize("check", contract.CHECKS, ids=lambda check: check.__name__.removeprefix("check_"))
def test_filter_passes(kind, check):
    check(Case(kind))
