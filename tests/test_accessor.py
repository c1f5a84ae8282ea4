"""What PyVista finds by itself: ``mesh.muscle`` and the readers, through the package's entry points."""

import os
import tomllib
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from commands import python

import vtkmuscle.accessor
from vtkmuscle.data.arrays import points_of
from vtkmuscle.filters import FibreMetrics, FixedPointDetector, attachments_of
from vtkmuscle.pipelines import decompose, deform

ROOT = Path(__file__).parents[1]


@pytest.fixture
def mesh(spindle):
    return pv.wrap(spindle.muscles["spindle"])


def landmarks_by_role(phantom):
    """Return {role: ring}, each ring ending at its first point."""
    areas = attachments_of(phantom.attachments["spindle"], "")
    return {area.role: np.vstack([area.landmarks, area.landmarks[:1]]) for area in areas}


def test_methods_give_what_the_filters_give(spindle, mesh):
    areas, bones = spindle.attachments["spindle"], spindle.bones
    fixed = mesh.muscle.fixed(bones, attachments=areas)
    assert np.array_equal(fixed["FixedTo"], FixedPointDetector().apply(mesh, bones, areas)["FixedTo"])
    fibres = mesh.muscle.fibres(attachments=areas, n_fibres=7)
    assert np.array_equal(fibres.points, points_of(decompose(mesh, areas, n_fibres=7).update().output))
    assert np.array_equal(fibres.muscle.fibre_lengths(), FibreMetrics().apply(fibres)["Length"])
    chain = deform(mesh, bones, spindle.motion, areas, fibres=fibres, iterations=2)
    for moved in (mesh, fixed):
        given = {"attachments": areas} if moved is mesh else {}
        bent = moved.muscle.deformed(bones, spindle.motion, time=4.0, fibres=fibres, iterations=2, **given)
        assert np.array_equal(bent.points, points_of(chain.update(time=4.0).output))
    last = fixed.muscle.deformed(bones, spindle.motion, iterations=2)
    assert np.array_equal(
        last.points, fixed.muscle.deformed(bones, spindle.motion, time=40.0, iterations=2).points
    )
    assert fibres.muscle.tubes(radius=0.5, sides=6).n_points > 7 * 16 * 6


def test_landmarks_may_be_given_by_role(spindle, mesh):
    areas, by_role = spindle.attachments["spindle"], landmarks_by_role(spindle)
    lines = {role: areas.GetBlock(i) for i, role in enumerate(by_role)}
    for given in (by_role, lines):
        fibres = mesh.muscle.fibres(n_fibres=5, **given)
        assert np.array_equal(fibres.points, mesh.muscle.fibres(attachments=areas, n_fibres=5).points)


def test_what_is_missing_or_too_much_is_said(spindle, mesh):
    areas, by_role = spindle.attachments["spindle"], landmarks_by_role(spindle)
    ring = by_role["origin"]
    for given in ({}, {"origin": ring, "attachments": areas}):
        with pytest.raises(ValueError, match=r"give either origin= and insertion=, or attachments="):
            mesh.muscle.fibres(**given)
    with pytest.raises(ValueError, match=r"array \(k, 3\)"):
        mesh.muscle.fibres(origin=[1.0, 2.0], insertion=ring)
    with pytest.raises(AttributeError, match="did you mean 'fibres'"):
        mesh.muscle.fibrs()
    with pytest.raises(TypeError, match="no_such"):
        mesh.muscle.deformed(spindle.bones, spindle.motion, attachments=areas, no_such=1)


# ---------------------------------------------------------------- discovery

DISCOVERY = """
import sys
import numpy as np
import pyvista as pv

assert not any(name.startswith("vtkmuscle") for name in sys.modules)
assert "muscle" in dir(pv.Sphere())
assert not any(name.startswith("vtkmuscle") for name in sys.modules)
print(pv.MultipleLines(np.eye(3)).muscle.fibre_lengths())
"""


def write_entry_points(folder):
    """Write what an installation of the package would tell of its entry points."""
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    lines = []
    for group, entries in groups.items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())]
    info = folder / "vtkmuscle-0.0.0.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: vtkmuscle\nVersion: 0.0.0\n")
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


def test_a_modellers_mesh_is_taken_as_triangles_with_shared_corners(spindle, mesh):
    corners = mesh.points[mesh.regular_faces].reshape(-1, 3)
    split = pv.PolyData.from_regular_faces(corners, np.arange(len(corners)).reshape(-1, 3))
    areas = spindle.attachments["spindle"]
    fixed = split.muscle.fixed(spindle.bones, attachments=areas)
    assert fixed.n_points == mesh.n_points
    assert (fixed["FixedTo"] >= 0).sum() == (
        mesh.muscle.fixed(spindle.bones, attachments=areas)["FixedTo"] >= 0
    ).sum()


def test_pyvista_finds_it_without_an_import(tmp_path):
    write_entry_points(tmp_path / "installed")
    path = os.pathsep.join([str(tmp_path / "installed"), str(Path(vtkmuscle.__file__).parents[1])])
    done = python("-W", "error", "-c", DISCOVERY, env={**os.environ, "PYTHONPATH": path})
    assert done.stdout == "[2.82842712]\n"
