import numpy as np
import pytest

from vtkmuscle.core.pbd.anderson import Workspace, anderson


def contraction(slowest=0.999, n=60, seed=3):
    """Return a linear map with eigenvalues from 0 to the slowest one, and its fixed point."""
    rng = np.random.default_rng(seed)
    basis, _ = np.linalg.qr(rng.normal(size=(n, n)))
    matrix = basis @ np.diag(1.0 - np.geomspace(1.0, 1.0 - slowest, n)) @ basis.T
    solution = rng.normal(size=n)
    offset = solution - matrix @ solution
    return lambda x: matrix @ x + offset, solution


def test_it_converges_where_the_plain_iteration_crawls():
    g, solution = contraction()
    fast = anderson(g, np.zeros(60), max_iterations=150)
    plain = anderson(g, np.zeros(60), max_iterations=150, workspace=Workspace(60, window=0))
    assert np.abs(fast.x - solution).max() < 1e-2
    assert np.abs(plain.x - solution).max() > 0.1


def test_window_zero_is_the_plain_iteration():
    g, _ = contraction()
    x = np.zeros(60)
    for _ in range(7):
        x = g(x)
    np.testing.assert_array_equal(
        anderson(g, np.zeros(60), max_iterations=7, workspace=Workspace(60, window=0)).x, x
    )


def test_a_window_as_large_as_the_space_solves_a_linear_map():
    matrix = np.array([[0.5, 0.3, 0.0], [-0.2, 0.9, 0.1], [0.0, 0.1, 0.95]])
    result = anderson(lambda x: matrix @ x + 1.0, np.zeros(3), max_iterations=8)
    np.testing.assert_allclose(result.x, np.linalg.solve(np.eye(3) - matrix, np.ones(3)), rtol=1e-6)


def test_the_start_and_the_memory_of_the_map_are_not_changed():
    start, image = np.ones(6), np.empty(6)

    def g(x):
        before = x.copy()
        np.multiply(0.5, x, out=image)
        np.testing.assert_array_equal(x, before)
        return image

    anderson(g, start, max_iterations=5)
    np.testing.assert_array_equal(start, 1.0)


def test_a_step_that_worsens_the_residual_is_taken_back():
    """A map with a kink: extrapolating across it lands where the residual is a hundred times larger."""

    def g(x):
        return np.where(x > 0.0, 0.99 * x, x + 100.0 * np.abs(x))

    result = anderson(g, np.linspace(1.0, 2.0, 9), max_iterations=200)
    assert result.restarts > 0
    assert np.isfinite(result.x).all()
    assert result.residual <= 2.0 * result.residuals[0]


def test_it_stops_at_the_residual_which_bounds_the_distance_of_a_contraction():
    g, solution = contraction()
    result = anderson(g, np.zeros(60), max_iterations=500, tolerance=1e-5)
    assert result.converged
    assert result.iterations < 500
    assert result.residual <= 1e-5
    # The slowest part of an error loses a thousandth of itself per iteration.
    assert np.linalg.norm(result.x - solution) / np.sqrt(20) < 1000.0 * 1e-5


def test_it_stops_on_a_fixed_point():
    result = anderson(lambda x: x, np.ones(6), max_iterations=10)
    assert (result.iterations, result.residual) == (1, 0.0)
    assert result.converged


def test_the_history_is_complete():
    g, _ = contraction()
    result = anderson(g, np.zeros(60), max_iterations=23)
    assert result.iterations == len(result.residuals) == 23
    assert result.residual == result.residuals[-1]


def test_the_same_input_gives_the_same_bits():
    g, _ = contraction()
    one, other = (anderson(g, np.zeros(60), max_iterations=60).x for _ in range(2))
    np.testing.assert_array_equal(one, other)


def test_a_map_that_leaves_the_numbers_is_an_error():
    with pytest.raises(FloatingPointError, match="floating point"):
        anderson(lambda x: x * np.nan, np.ones(3), max_iterations=3)


def test_components_that_are_named_unsteady_do_not_choose_the_combination():
    g, _ = contraction()
    rng = np.random.default_rng(0)

    def steady_part(unsteady, size):
        jumps = iter(size * rng.normal(size=(20, 3)))
        result = anderson(
            lambda x: np.append(g(x[:60]), x[60:] + next(jumps)),
            np.zeros(63),
            max_iterations=20,
            unsteady=unsteady,
        )
        assert result.restarts == 0
        return result.x[:60]

    named = np.arange(63) >= 60
    quiet = anderson(g, np.zeros(60), max_iterations=20).x
    np.testing.assert_allclose(steady_part(named, 1e-3), quiet, rtol=0, atol=1e-6)
    assert np.abs(steady_part(None, 1e-3) - quiet).max() > 1e-4


def test_memory_that_served_before_changes_nothing(rng):
    matrix = rng.normal(size=(30, 30))
    matrix *= 0.9 / np.abs(np.linalg.eigvals(matrix)).max()
    workspace = Workspace(30)
    for offset in rng.normal(size=(3, 30)):
        runs = [
            anderson(lambda x, b=offset: matrix @ x + b, np.zeros(30), max_iterations=25, workspace=memory)
            for memory in (None, workspace)
        ]
        np.testing.assert_array_equal(runs[0].x, runs[1].x)
        np.testing.assert_array_equal(runs[0].residuals, runs[1].residuals)
    assert runs[1].x is not workspace.x
