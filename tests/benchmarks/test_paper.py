"""Each experiment of the papers runs on the phantom hip, in its short form, and shows what was published."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / "benchmarks" / "paper"
SCRIPTS = sorted(path.stem for path in FOLDER.glob("p[12]*.py"))
#: Those that are quick even on the phantom; the others are run with ``-m study``.
QUICK = {"p12_fig4", "p12_fig6", "p12_fig8_9", "p21_fig4_5", "p21_fig10", "p21_fig11"}


@pytest.fixture(scope="module")
def case():
    """The phantom hip, for all of them."""
    if not FOLDER.is_dir():
        pytest.skip("the benchmarks are not here")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "path", [str(FOLDER), *sys.path])
        from common import Case

        yield Case(real=False, short=True)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.study) for name in SCRIPTS]
)
def test_experiment_runs_on_the_phantom(name, case):
    tables = importlib.import_module(name).tables(case)
    for table in tables:
        assert table.rows
        assert table.text().count("\n") == len(table.rows) + 1
        assert table.rst().startswith(".. list-table:: ")
    assert any("published" in column for table in tables for column in table.columns)


def test_the_command_line_knows_all_experiments(case):
    assert sorted(importlib.import_module("all_experiments").EXPERIMENTS) == SCRIPTS


def test_settings_of_the_paper_are_all_named(case):
    """A default that changes must not change what is called P21."""
    from common import P21

    from vtkmuscle.filters import PBDDeformer

    deformer = PBDDeformer(**P21)
    choices = {name for name in P21 if isinstance(P21[name], str)}
    assert {name: getattr(deformer, name) for name in P21} == P21
    assert choices == {
        "anisotropy",
        "bone_push",
        "collision",
        "contact_velocity",
        "order",
        "solver",
        "start",
    }


def test_roughness_is_the_angle_between_triangles(case):
    """The edges of a regular tetrahedron turn by 180 - 70.53 degrees."""
    from common import roughness

    from vtkmuscle.filters.arrays import surface_from

    points = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    triangles = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])
    assert roughness(surface_from(points, triangles)) == pytest.approx(109.4712, abs=1e-3)


def test_a_step_is_timed_once_the_first_is_made(case):
    chain = case.chain("iliacus", iterations=1)
    assert chain.step_times([0.0, 2.0, 4.0]).shape == (2,)
    assert (chain.at(4.0).GetNumberOfPoints(), chain.fibres_at(4.0).GetNumberOfCells()) == (
        case.scene.muscles["iliacus"].surface.GetNumberOfPoints(),
        20,
    )
