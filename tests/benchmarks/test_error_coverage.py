"""The errors that a run states cover the true ones on phantoms with known answers."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture(scope="module")
def coverage():
    """The benchmark that compares stated errors with true ones."""
    if not FOLDER.is_dir():
        pytest.skip("the benchmarks are not here")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(FOLDER), *sys.path])
        import error_coverage

        yield error_coverage


def shares(coverage, found):
    """Return per quantity the part of the poses that are covered."""
    quantities = {}
    for one in found:
        quantities.setdefault(one.quantity, []).append(one)
    return {quantity: c / n for quantity, of_it in quantities.items() for c, n in [coverage.share(of_it)]}


@pytest.mark.xfail(strict=True, reason="measured: 0.77 of the moment arms; paths that bulge are not in them")
def test_stated_errors_cover_the_true_ones_on_two_phantoms(coverage):
    cases = {case.name: case for case in coverage.known_phantoms()}
    wanted = ("flexor_over_brim, ridge", "spindle_over_ball, flexion")
    found = [one for name in wanted for one in coverage.compared(cases[name], every=6, errors=["model"])]
    found += coverage.compared_block("pennate")
    covered = shares(coverage, found)
    assert covered.keys() == {"moment arm", "length", "fibre length", "area"}
    assert min(covered.values()) >= 0.9


@pytest.mark.study
def test_stated_errors_cover_the_true_ones_in_nine_of_ten_poses(coverage):
    covered = shares(coverage, list(coverage.all_compared(errors=True)))
    assert min(covered.values()) >= 0.9
