"""The filter of the page "Add a filter" is held to the contract of all filters."""

import doctest
import importlib.util
import sys
from pathlib import Path

import contract
import numpy as np
import pytest
from filter_case import Case

from examples import fibres
from vtkmuscle.data.arrays import polylines_of

DOCS = Path(__file__).parents[2] / "docs"


@pytest.fixture(scope="module")
def cropper():
    specification = importlib.util.spec_from_file_location(
        "fibre_cropper", DOCS / "how_to" / "fibre_cropper.py"
    )
    module = importlib.util.module_from_spec(specification)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "fibre_cropper", module)  # pickle looks for it there
        specification.loader.exec_module(module)
        yield module.FibreCropper


def test_the_page_shows_this_code():
    page = (DOCS / "how_to" / "add_a_filter.rst").read_text(encoding="utf-8")
    assert "literalinclude:: fibre_cropper.py" in page


@pytest.mark.parametrize("check", contract.CHECKS, ids=lambda check: check.__name__)
def test_the_filter_passes(cropper, check):
    check(Case(cropper))


def test_its_examples_run(cropper):
    assert doctest.testmod(sys.modules[cropper.__module__]).failed == 0


def test_it_cuts_the_ends(cropper):
    lines = polylines_of(cropper(part=0.1)(fibres()), "cut")
    assert np.allclose(lines.line(0)[[0, -1], 2], [80.0 - 14.0, 80.0 - 126.0])
