"""The order of edges, and their projections against formulas in plain NumPy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spindle import spindle

from vtkmuscle.core.jit import LANES
from vtkmuscle.core.mesh.rest_shape import dihedral_angles
from vtkmuscle.core.mesh.surface import edge_lengths, mesh_topology
from vtkmuscle.core.pbd.sweep import chord_from, edge_rows, project_edges, rows_of_edges, turn_from

POINTS, TRIANGLES, FIXED_TO = spindle(seed=4)
TOPOLOGY = mesh_topology(len(POINTS), TRIANGLES)
QUADS = TOPOLOGY.quads


def test_each_edge_is_in_a_row_with_no_other_of_its_points():
    rows = rows_of_edges(QUADS, len(POINTS))
    assert sorted(rows[rows >= 0].tolist()) == list(range(len(QUADS)))
    for row in rows:
        points = QUADS[row[row >= 0]].reshape(-1)
        assert len(set(points.tolist())) == len(points)
    assert rows.shape[1] == LANES


@given(phi=st.floats(-math.pi, math.pi), phi0=st.floats(-math.pi, math.pi), size=st.floats(1e-3, 1e3))
def test_a_turn_is_the_difference_of_angles(phi, phi0, size):
    given = size * math.sin(phi), size * math.cos(phi), size**2, math.cos(phi0), math.sin(phi0)
    turn, expected = turn_from(*given), math.remainder(phi - phi0, 2.0 * math.pi)
    assert abs(math.remainder(turn - expected, 2.0 * math.pi)) < 2e-14
    assert abs(turn) <= math.pi + 1e-15
    assert abs(chord_from(*given) - 2.0 * math.sin(0.5 * turn)) < 2e-14


def projected(p, mass, rows, *, lengths=True, angles=True, signed=True):
    extended = np.vstack([p, np.zeros(3)])
    project_edges(extended, rows.points, rows.constants, lengths, angles, signed, np.empty(12 * LANES))
    assert not extended[-1].any()
    return extended[:-1]


def numerical_gradient(value, p, step=1e-6):
    gradient = np.empty_like(p)
    for index in np.ndindex(p.shape):
        shifted = p.copy()
        shifted[index] += step
        up = value(shifted)
        shifted[index] -= 2 * step
        gradient[index] = (up - value(shifted)) / (2 * step)
    return gradient


@pytest.mark.parametrize(("signed", "limit"), [(True, 3.0), (False, 10.0)])
def test_a_soft_edge_with_signed_angles_yields_to_three_rest_lengths(signed, limit):
    rows = edge_rows(np.array([[0, 1, 2, 3]]), np.ones(4), np.ones(1), *np.zeros((3, 1)))
    for length in (0.5, 2.0, 10.0):
        p = np.array([[0.0, 0, 0], [length, 0, 0], [0, 1, 0], [0, -1, 0]])
        assert np.ptp(projected(p, np.ones(4), rows, signed=signed)[:2, 0]) == min(length, limit)


@pytest.mark.parametrize("signed", [True, False])
def test_an_edge_is_projected_as_eq_1_says(rng, signed):
    """One edge at a time: gradients by finite differences; a signed angle's step has the turn's chord."""
    lengths, angles = edge_lengths(POINTS, QUADS[:, :2]), dihedral_angles(POINTS, QUADS)[0]
    p = POINTS + rng.normal(scale=0.3, size=POINTS.shape)
    for edge in rng.choice(len(QUADS), 12, replace=False):
        local = np.array([[0, 1, 2, 3]])
        mass = np.array([1.0, 0.0, 1.0, 1.0])
        rest = angles[[edge]] if signed else abs(angles[[edge]])
        rows = edge_rows(local, mass, lengths[[edge]], np.array([0.7]), rest, np.array([0.9]))

        def length(q, rest=lengths[edge]):
            return float(np.linalg.norm(q[1] - q[0])) - rest

        def angle(q, rest=rest[0], local=local):
            phi = float(dihedral_angles(q, local)[0][0])
            return (phi if signed else abs(phi)) - rest

        start = p[QUADS[edge]]
        expected = start.copy()
        for value, stiffness in ((length, 0.7), (angle, 0.9)):
            gradient = numerical_gradient(value, expected)
            off = value(expected)
            off = 2.0 * math.sin(off / 2.0) if signed and value is angle else off
            step = stiffness * off * gradient / (gradient**2).sum()
            expected = expected - mass[:, None] * step
        found = projected(start, mass, rows, signed=signed)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-6)
        assert np.array_equal(found[1], start[1])
