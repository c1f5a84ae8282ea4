import numpy as np
import pytest
import pyvista as pv
from phantoms import fibre_block
from phantoms.winding_spindle import LENGTH, winding_fibre, winding_fibres, winding_surface
from shapes import lines_of

from vtkmuscle.data.arrays import points_of
from vtkmuscle.filters import FibreField, FibreSource
from vtkmuscle.phantoms import spindle_over_hinge

#: The block's sides [mm].
SIDES = np.array([20.0, 40.0, 120.0])


@pytest.fixture(scope="module")
def pennate():
    """The block's muscle, its fibres, and the direction of all of them."""
    phantom = fibre_block("pennate")
    muscle = phantom.muscles["block"]
    fibres = FibreSource(n_fibres=200)(muscle, phantom.attachments["block"])
    return muscle, fibres, np.array([20.0, 0.0, 60.0]) / np.hypot(20, 60)


def image(spacing=4.0, margin=0.0):
    counts = np.round((SIDES + 2 * margin) / spacing).astype(int) + 1
    return pv.ImageData(dimensions=counts, spacing=[spacing] * 3, origin=[-margin] * 3)


def meshes():
    grid = image()
    return {
        "image": grid,
        "rectilinear": grid.cast_to_rectilinear_grid(),
        "structured": grid.cast_to_structured_grid(),
        "tetrahedra": grid.to_tetrahedra(5),
        "polydata": grid.extract_surface(algorithm="dataset_surface").triangulate(),
    }


def off(directions, truth):
    """Return the angles between directions, sign included [degrees]."""
    across = np.linalg.norm(np.cross(directions, truth), axis=-1)
    return np.degrees(np.arctan2(across, (directions * truth).sum(axis=-1)))


@pytest.mark.parametrize("at", ["cells", "points"])
@pytest.mark.parametrize("kind", meshes())
def test_any_mesh_gets_the_known_direction(kind, at, pennate):
    muscle, fibres, truth = pennate
    mesh = meshes()[kind]
    mesh["Mine"] = np.arange(mesh.n_points)
    field = FibreField(at=at).apply(mesh, fibres, muscle)
    assert type(field) is type(mesh)
    data, other = (field.cell_data, field.point_data)[:: 1 if at == "cells" else -1]
    assert {"FibreDirection", "FibreDistance", "InMuscle"} <= {*data.keys()}
    assert "FibreDirection" not in other
    assert np.array_equal(field["Mine"], mesh["Mine"])
    assert "FibreDirection" not in mesh.array_names
    assert off(data["FibreDirection"], truth).max() < 2.0
    assert np.abs(np.linalg.norm(data["FibreDirection"], axis=1) - 1).max() < 1e-12
    assert (data["InMuscle"] == 1).all()


def test_bipennate_fibres_lean_to_both_sides():
    phantom = fibre_block("bipennate")
    muscle = phantom.muscles["block"]
    fibres = FibreSource(n_fibres=800)(muscle, phantom.attachments["block"])
    field = FibreField().apply(image(2.0), fibres, muscle)
    x = field.cell_centers().points[:, 0]
    lean = np.where(x < 10.0, 1.0, -1.0)
    truth = np.column_stack([10.0 * lean, 0 * x, np.full(len(x), 60.0)]) / np.hypot(10, 60)
    where = (field["FibreDistance"] < 2.0) & (np.abs(x - 10.0) > 3.0)
    assert where.mean() > 0.3
    errors = off(field["FibreDirection"], truth)[where]
    assert np.median(errors) < 1.0
    assert np.percentile(errors, 95) < 3.0


def test_a_winding_muscles_field_winds():
    twist, fibres = 90.0, lines_of(winding_fibres(200))
    muscle = winding_surface()
    mesh = pv.ImageData(dimensions=(15, 15, 41), spacing=(2.5, 2.5, 2.5), origin=(-17.5, -17.5, 10.0))
    field = FibreField().apply(mesh, fibres, muscle)
    inside = field["InMuscle"] == 1
    x, y, z = field.cell_centers().points[inside].T
    start = np.arctan2(y, x) - np.radians(twist) * z / LENGTH
    part, steps = np.hypot(x, y) / np.hypot(*_on_surface(z).T), np.array([-1e-4, 1e-4])
    ends = np.array(
        [winding_fibre(q, a, twist, t / LENGTH + steps) for q, a, t in zip(part, start, z, strict=True)]
    )
    ways = ends[:, 1] - ends[:, 0]
    errors = off(field["FibreDirection"][inside], ways / np.linalg.norm(ways, axis=1)[:, None])
    assert np.median(errors) < 4.0


def _on_surface(z):
    return winding_fibre(1.0, 0.0, 0.0, z / LENGTH)[:, :2]


def test_what_is_outside_is_marked():
    phantom = spindle_over_hinge()
    muscle = phantom.muscles["spindle"]
    fibres = FibreSource(n_fibres=100)(muscle, phantom.attachments["spindle"])
    bounds = np.array(muscle.GetBounds()).reshape(3, 2)
    mesh = pv.ImageData(
        dimensions=(11, 11, 21),
        origin=bounds[:, 0] - 10,
        spacing=(np.ptp(bounds, axis=1) + 20) / [10, 10, 20],
    )
    field = FibreField(at="points").apply(mesh, fibres, muscle)
    distance = mesh.compute_implicit_distance(pv.wrap(muscle))["implicit_distance"]
    assert np.array_equal(field["InMuscle"] == 1, distance <= 0.0)
    assert 0.02 < field["InMuscle"].mean() < 0.5
    # Without the surface it is an estimate.
    guess = FibreField(at="points").apply(mesh, fibres)["InMuscle"]
    clear = np.abs(distance) > 4.0
    assert np.array_equal(guess[clear], field["InMuscle"][clear])
    assert np.isfinite(field["FibreDirection"]).all()


def test_nodes_on_the_surface_are_in_the_muscle_in_single_precision_too():
    phantom = spindle_over_hinge()
    muscle = phantom.muscles["spindle"]
    fibres = FibreSource(n_fibres=50)(muscle, phantom.attachments["spindle"])
    rounded = pv.PolyData(points_of(muscle).astype(np.float32))
    assert rounded.points.dtype == np.float32
    assert (FibreField(at="points").apply(rounded, fibres, muscle)["InMuscle"] == 1).all()


def test_distances_are_those_of_the_fibres(pennate):
    muscle, _, _ = pennate
    lines = pv.MultipleLines([(0.0, 0, 0), (0, 0, 120)])
    field = FibreField(at="points").apply(image(10.0), lines, muscle)
    x, y, _ = field.points.T
    assert np.allclose(field["FibreDistance"], np.hypot(x, y))
