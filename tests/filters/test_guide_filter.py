"""The filter of the page "Add a filter" is held to the contract of all filters."""

import importlib.util
import sys
from pathlib import Path

import contract
import contract_declarations
import numpy as np
import pytest
from filter_case import Case, poisoned

from examples import fibres
from vtkmuscle.data.arrays import polylines_of
from vtkmuscle.plotting import can_render

DOCS = Path(__file__).parents[2] / "docs"
CHECKS = {
    name: check
    for module in (contract, contract_declarations)
    for name, check in vars(module).items()
    if name.startswith("check_") and name not in ("check_pyvista_shows_it",)
}
#: Checks that take more than a case, as the contract suite calls them.
WITH_MORE = {
    "check_points_that_are_not_finite_never_come_out": lambda check, case: check(case, 0),
    "check_bad_inputs_raise_each_time_and_are_mended": lambda check, case: check(case, 0, poisoned),
    "check_abort_leaves_no_output": lambda check, case: check(case, after=0.0),
}


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


@pytest.mark.parametrize("name", sorted(CHECKS))
def test_the_filter_passes(cropper, name):
    call = WITH_MORE.get(name, lambda check, case: check(case))
    call(CHECKS[name], Case(cropper))


def test_pyvista_shows_it(cropper):
    reason = can_render()
    if reason is not None:
        pytest.skip(reason)
    contract.check_pyvista_shows_it(Case(cropper))


def test_it_cuts_the_ends(cropper):
    lines = polylines_of(cropper(part=0.1)(fibres()), "cut")
    assert np.allclose(lines.line(0)[[0, -1], 2], [80.0 - 14.0, 80.0 - 126.0])
