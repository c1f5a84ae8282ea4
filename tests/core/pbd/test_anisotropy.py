import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from spindle import spindle

from vtkmuscle.core.mesh.surface import mesh_topology
from vtkmuscle.core.pbd.sweep import edge_stiffness, fibre_directions_at, harmonic_directions


def test_stiffness_is_zero_along_and_one_across_whatever_the_sign():
    points = np.array([[0.0, 0, 0], [2, 0, 0], [0, 3, 0], [1, 1, 0], [0, 0, 0]])
    edges = np.array([[0, 1], [1, 0], [0, 2], [0, 3], [0, 4]])
    stiffness = edge_stiffness(points, edges, np.tile([-1.0, 0, 0], (5, 1)))
    assert np.allclose(stiffness, [0, 0, 1, 1 - np.sqrt(0.5), 1])


@settings(max_examples=25)
@given(seed=st.integers(0, 10**6), segments=st.integers(1, 60), spread=st.floats(0.01, 10.0))
def test_a_fibre_direction_is_that_of_the_nearest_segment_of_all(seed, segments, spread):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(segments, 3))
    along = rng.normal(scale=spread, size=(segments, 3)) * rng.uniform(0.1, 1.0, (segments, 1)) ** 4
    queries = rng.normal(scale=2.0, size=(40, 3))
    t = ((queries[:, None] - a) * along).sum(axis=2) / (along**2).sum(axis=1)
    distances = np.linalg.norm(queries[:, None] - a - np.clip(t, 0, 1)[..., None] * along, axis=2)
    units = along / np.linalg.norm(along, axis=1)[:, None]
    fibres = np.stack([a, a + along], axis=1).reshape(-1, 3), 2 * np.arange(segments + 1)
    directions = fibre_directions_at(queries, *fibres)
    of_segment = np.isclose(directions[:, None], units, atol=1e-6).all(axis=2)
    assert (of_segment & (distances <= distances.min(axis=1)[:, None] + 1e-6)).any(axis=1).all()


def test_of_two_segments_with_a_common_nearest_point_the_first_counts_wherever_the_muscle_is(rng):
    for _ in range(50):
        turned = np.linalg.qr(rng.normal(size=(3, 3)))[0].T
        shift = rng.uniform(-500, 500, 3)
        fibre = np.array([[-5.0, 0, -1], [0, 0, 0], [5, 0, -1]]) @ turned + shift
        queries = np.array([[3.0, 0, 1], [0, 0, 9]]) @ turned + shift
        directions = fibre_directions_at(queries, fibre, np.array([0, 3]))
        assert np.allclose(directions, [fibre[2] - fibre[1], fibre[1] - fibre[0]] / np.sqrt(26))


def test_harmonic_directions_run_along_the_muscle():
    points, triangles, fixed_to = spindle(rings=20, around=12)
    topology = mesh_topology(len(points), triangles)
    directions = harmonic_directions(points, topology, fixed_to)
    free = (fixed_to[topology.edges] < 0).all(axis=1)
    assert np.allclose(np.linalg.norm(directions[free], axis=1), 1.0)
    assert np.abs(directions[free, 2]).min() > 0.8
    stiffness = edge_stiffness(points, topology.edges, directions)
    around = np.ptp(points[topology.edges][:, :, 2], axis=1) == 0
    assert stiffness[free & around].min() > 0.9
    assert harmonic_directions(points, topology, np.where(fixed_to == 1, -1, fixed_to)) is None  # one bone
