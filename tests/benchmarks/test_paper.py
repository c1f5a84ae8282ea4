"""Each experiment of the papers runs on the phantom hip, in its short form, and shows what was published."""

from __future__ import annotations

import importlib
import re
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

FOLDER = Path(__file__).parents[2] / "benchmarks" / "paper"
SCRIPTS = sorted(path.stem for path in FOLDER.glob("kohout*.py"))
#: Those that are quick even on the phantom; the others are run with ``-m study``.
QUICK = {
    "kohout2012_fig4",
    "kohout2012_fig6",
    "kohout2012_fig8_9",
    "kohout2021_fig4_5",
    "kohout2021_fig10",
    "kohout2021_fig11",
}


#: Their tables, made by ``python benchmarks/remake.py --phantom``; what numbers in them may differ by between
#: machines, as a part and as a number.
TABLES = Path(__file__).parent / "phantom_tables"
NOISE, SMALL = 0.05, 0.02
REMAKE = "if that is meant to be: python benchmarks/remake.py --phantom, and --stale for the pages"


@pytest.fixture(scope="module")
def case(benchmarks):
    """The phantom hip, for all of them."""
    from common import Case

    return Case(real=False, short=True)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.study) for name in SCRIPTS]
)
def test_experiment_runs_on_the_phantom(name, case):
    tables = importlib.import_module(name).tables(case)
    for table in tables:
        assert table.rows
        assert table.text().count("\n") == len(table.rows) + 1
        assert table.rst().startswith(".. list-table:: ")
    assert any("published" in table.text() for table in tables)
    if name in QUICK:
        expected = (TABLES / f"{name}.txt").read_text(encoding="utf-8")
        found = "\n".join(table.rst() for table in tables)
        assert in_words(found) == in_words(expected), REMAKE
        for one, other in zip(numbers(found), numbers(expected), strict=True):
            assert abs(one - other) <= NOISE * max(abs(one), abs(other)) + SMALL, REMAKE


#: A number of a table.
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")


def in_words(text):
    """Return a table without its numbers."""
    return NUMBER.sub("#", text)


def numbers(text):
    """Return the numbers of a table."""
    return [float(found) for found in NUMBER.findall(text)]


def test_the_phantom_s_tables_are_those_of_the_quick_experiments(case):
    assert {path.stem for path in TABLES.glob("*.txt")} == QUICK


def test_the_command_line_knows_all_experiments(case):
    assert sorted(importlib.import_module("all_experiments").EXPERIMENTS) == SCRIPTS


def test_settings_of_the_paper_are_all_named(case):
    """A default that changes must not change what is called published."""
    from vtkmuscle.core.pbd.solver import PUBLISHED, Parameters

    assert Parameters(**PUBLISHED) == Parameters(
        iterations=10,
        prediction="velocity",
        signed_angles=False,
        order="kind",
        finish=False,
        dt=1.0,
        velocity_kept=0.99,
        stiffness=1.0,
        shape_stiffness=0.9,
        volume_stiffness=1.0,
        anisotropy="fibres",
        external_force=(0.0, 0.0, 0.0),
        bone_push="transform",
        contact_velocity="keep",
    )


@pytest.mark.parametrize("model", ["as printed", "stable", "default model"])
def test_position_based_dynamics_has_no_paths_and_carries_fibres_by_all_weights(case, model):
    chain = case.chain("iliacus", model)
    assert (chain.taut_paths is None) == (model != "default model")
    assert getattr(chain.moved, "weight_tolerance", 0.0) == 0.0
    lengths = chain.lengths(case.motion.times[:2])
    assert lengths.shape == (2, 20)
    assert 0.0 < np.abs(lengths[1] - lengths[0]).max() < 5.0


def test_the_published_loop_stays_at_rest_and_follows_a_bone(case):
    from published_loop import run

    from vtkmuscle.core.mesh.surface import mesh_topology
    from vtkmuscle.core.motion.rigid import rotation_about

    body = pv.Sphere(radius=20.0, theta_resolution=16, phi_resolution=16)
    points, triangles = np.asarray(body.points, dtype=float), body.regular_faces.astype(np.int64)
    fixed_to = np.where(points[:, 2] < -15.0, 0, np.where(points[:, 2] > 15.0, 1, -1))
    stiffness = np.ones(len(mesh_topology(len(points), triangles).edges))
    still = np.array([[np.eye(4)] * 2])
    moves, share, end = run(points, triangles, fixed_to, stiffness, still, 5)
    assert moves.max() < 1e-9
    assert share == 0.0
    turned = np.array([[np.eye(4), rotation_about((0, 0, 0), (1, 0, 0), 10.0)]])
    moves, share, end = run(points, triangles, fixed_to, stiffness, turned, 50)
    assert moves.shape == (1, 50)
    assert moves[0, 0] > 2.0 * moves[0, -1] > 0.0
    held = fixed_to == 1
    np.testing.assert_allclose(end[held], points[held] @ turned[0, 1, :3, :3].T, atol=1e-9)
