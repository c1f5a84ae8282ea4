"""The rest shape that follows the fibres: stretched as their ends are drawn apart, by known amounts."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spindle import spindle

from vtkmuscle.core.anisotropy import edge_stiffness, following_stiffness
from vtkmuscle.core.constraints import dihedral_angle
from vtkmuscle.core.fibre_stretch import FibreStretch, stretch_of_fibres, stretch_of_harmonic
from vtkmuscle.core.mesh import edge_lengths, signed_volume
from vtkmuscle.core.rigid import apply_transform, rotation_about
from vtkmuscle.core.solver import MuscleSolver, SolverParameters
from vtkmuscle.core.stretched_shape import StretchedShape
from vtkmuscle.core.topology import mesh_topology

LENGTH = 100.0


def muscle():
    points, triangles, fixed_to = spindle(rings=24, around=16, length=LENGTH)
    return points, mesh_topology(len(points), triangles), fixed_to


def straight_fibres():
    """Return fibres along z from end to end, at several places of the cross-section."""
    offsets = [(0.0, 0.0), (4.0, 0.0), (-4.0, 0.0), (0.0, 4.0), (0.0, -4.0)]
    z = np.linspace(-0.48 * LENGTH, 0.48 * LENGTH, 13)
    points = np.vstack([np.column_stack([np.full(13, x), np.full(13, y), z]) for x, y in offsets])
    return points, 13 * np.arange(len(offsets) + 1)


def drawn_apart(length):
    """Return transforms that take the upper end away by a length."""
    up = np.eye(4)
    up[2, 3] = length
    return np.array([np.eye(4), up])


def of_fibres() -> FibreStretch:
    return stretch_of_fibres(*muscle(), *straight_fibres())


def of_harmonic() -> FibreStretch:
    return stretch_of_harmonic(*muscle())


BOTH = pytest.mark.parametrize("made", [of_fibres, of_harmonic])


@BOTH
def test_bones_that_move_together_do_not_stretch(made):
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec([0.3, -0.7, 1.1]).as_matrix()
    turn[:3, 3] = [30.0, -20.0, 5.0]
    np.testing.assert_array_equal(made().at(np.array([np.eye(4)] * 2)), 1.0)
    np.testing.assert_allclose(made().at(np.array([turn] * 2)), 1.0, atol=1e-12)


@pytest.mark.parametrize("longer", [-20.0, 24.0])
def test_the_stretch_is_that_of_the_fibres(longer):
    stretch = of_fibres().at(drawn_apart(longer))
    np.testing.assert_allclose(stretch, 1.0 + longer / (0.96 * LENGTH), rtol=1e-12)


def test_without_fibres_it_is_that_of_the_free_part():
    """The lines go up and down along the muscle's edges, from one fixed patch to the other."""
    points, topology, fixed_to = muscle()
    between = points[fixed_to == 1, 2].min() - points[fixed_to == 0, 2].max()
    stretch = of_harmonic().at(drawn_apart(20.0))
    free = (fixed_to[topology.edges] < 0).any(axis=1)
    np.testing.assert_allclose(stretch[free], 1.0 + 20.0 / between, rtol=1e-3)


def test_beside_each_fibre_its_own_stretch_counts():
    """One bone turns about the middle of the upper end: fibres get shorter on one side."""
    points, topology, _ = muscle()
    turned = np.array([np.eye(4), rotation_about([0.0, 0.0, 0.5 * LENGTH], [1, 0, 0], 30.0)])
    stretch = of_fibres().at(turned)
    side = points[topology.edges].mean(axis=1)[:, 1]
    assert stretch[side < -8.0].min() < 1.0 < stretch[side > 8.0].max()
    assert np.corrcoef(side, stretch)[0, 1] > 0.8


def test_the_rest_shape_is_that_of_the_quadruple_stretched():
    """Lengths and angles agree with a muscle whose points are moved by F, one stretch everywhere."""
    rng = np.random.default_rng(1)
    points, triangles, _ = spindle(seed=2)
    topology = mesh_topology(len(points), triangles)
    v = rng.normal(size=3)
    v /= np.linalg.norm(v)
    k = len(topology.edges)
    for stretch, thinning in ((0.7, 1.0), (1.4, 0.5), (1.3, 0.0), (1.0, 1.0)):
        shape = StretchedShape(points, topology, np.tile(v, (k, 1)), thinning=thinning)
        lengths, cosines, sines = shape.at(np.full(k, stretch))
        across = stretch ** (-thinning / 2)
        moved = points @ (across * np.eye(3) + (stretch - across) * np.outer(v, v))
        np.testing.assert_allclose(lengths, edge_lengths(moved, topology.edges), rtol=1e-12)
        angles, defined = dihedral_angle(*(moved[topology.quads[:, c]] for c in range(4)))
        assert defined.all()
        np.testing.assert_allclose(cosines[topology.quad_edges], np.cos(angles), atol=1e-12)
        np.testing.assert_allclose(sines[topology.quad_edges], np.sin(angles), atol=1e-12)
        if thinning == 1.0:
            assert signed_volume(moved, triangles) == pytest.approx(signed_volume(points, triangles))


def test_each_edge_has_a_stretch_of_its_own(rng):
    """Edge by edge, against the vectors of its two triangles, stretched; also where no direction is known."""
    points, triangles, _ = spindle(seed=2)
    points[7] = points[8]  # triangles that have collapsed
    topology = mesh_topology(len(points), triangles)
    k = len(topology.edges)
    v = rng.normal(size=(k, 3))
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    v[::5] = 0.0
    stretch = rng.uniform(0.25, 4.0, k)
    lengths, cosines, sines = StretchedShape(points, topology, v, thinning=0.5).at(stretch)
    across = stretch**-0.25
    outer = np.einsum("ki,kj->kij", v, v)
    f = across[:, None, None] * np.eye(3) + (stretch - across)[:, None, None] * outer
    e = np.einsum("kij,kj->ki", f, points[topology.edges[:, 1]] - points[topology.edges[:, 0]])
    np.testing.assert_allclose(lengths, np.linalg.norm(e, axis=1), rtol=1e-12)
    quads, at = topology.quads, topology.quad_edges
    corners = [np.einsum("kij,kj->ki", f[at], points[quads[:, c]] - points[quads[:, 0]]) for c in range(4)]
    angles, defined = dihedral_angle(*corners)
    assert not defined.all()
    np.testing.assert_allclose(cosines[at[defined]], np.cos(angles[defined]), atol=1e-12)
    np.testing.assert_allclose(sines[at[defined]], np.sin(angles[defined]), atol=1e-12)
    np.testing.assert_allclose(cosines[at[~defined]], 1.0)


def test_edges_give_way_along_the_fibres_and_short_ones_less():
    points = np.array([[0.0, 0, 0], [0, 0, 4.0], [4.0, 0, 0], [0, 0, 1.0]])
    edges, along = np.array([[0, 1], [0, 2], [0, 3]]), np.tile([0.0, 0, 1], (3, 1))
    np.testing.assert_allclose(following_stiffness(points, edges, along), [0.1, 1.0, 1 - 0.9 / 3])
    assert edge_stiffness(points, edges, along)[0] == 0.0


def solved(made, transforms, **settings):
    points, topology, fixed_to = muscle()
    stretch = made()
    solver = MuscleSolver(
        points,
        topology.triangles,
        fixed_to,
        SolverParameters(iterations=400, **settings),
        edge_stiffness=following_stiffness(points, topology.edges, stretch.directions),
        stretch=stretch,
    )
    return solver, solver.step(solver.rest_state(2), transforms)


@BOTH
@pytest.mark.parametrize("order", ["colour", "sequential"])
def test_a_muscle_that_shortens_gets_thicker_and_stays_straight(made, order):
    points, topology, _ = muscle()
    solver, state = solved(made, drawn_apart(-20.0), order=order)
    p = state.positions + solver.centre
    # In the order of P21 the volume is not what is projected last.
    rel = 1e-6 if order == "colour" else 1e-3
    expected = signed_volume(points, topology.triangles)
    assert signed_volume(p, topology.triangles) == pytest.approx(expected, rel=rel)
    belly = np.abs(points[:, 2]) < 10.0
    radius = np.linalg.norm(p[belly, :2], axis=1) / np.linalg.norm(points[belly, :2], axis=1)
    assert radius.min() > 1.05
    assert radius.max() < 1.25
    assert np.abs(p[belly, :2].mean(axis=0)).max() < 0.5
    height = p[np.argsort(points[:, 2], kind="stable"), 2].reshape(-1)
    assert (np.diff(height[1:-1].reshape(24, 16).mean(axis=1)) > 0).all()


def test_the_frame_does_not_depend_on_the_frames_before():
    """The rest shape comes from the bones alone: a solver that was elsewhere gives the same bits."""
    solver, state = solved(of_fibres, drawn_apart(-10.0))
    solver.step(solver.rest_state(2), drawn_apart(30.0))
    again = solver.step(solver.rest_state(2), drawn_apart(-10.0))
    np.testing.assert_array_equal(state.positions, again.positions)


def test_a_rigid_motion_of_everything_leaves_no_strain():
    turn = rotation_about([10.0, 0.0, 0.0], [0.3, 1.0, 0.2], 40.0)
    solver, state = solved(of_harmonic, np.array([turn] * 2))
    points = muscle()[0]
    np.testing.assert_allclose(state.positions + solver.centre, apply_transform(turn, points), atol=1e-6)
