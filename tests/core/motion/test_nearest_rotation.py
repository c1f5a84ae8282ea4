"""Nearest rotations against the singular value decomposition."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from vtkmuscle.core.motion.blending import nearest_rotations


def rotation_of(matrix):
    return nearest_rotations(np.array([matrix], dtype=np.float64))[0]


def by_decomposition(matrix):
    u, _, vt = np.linalg.svd(matrix)
    u[:, 2] *= np.sign(np.linalg.det(u @ vt))
    return u @ vt


def test_random_matrices_and_mirrored_ones():
    for matrix in np.random.default_rng(0).normal(size=(200, 3, 3)):
        for sign in (1.0, -1.0):
            assert_allclose(rotation_of(sign * matrix), by_decomposition(sign * matrix), atol=1e-9)


@pytest.mark.parametrize("stretch", [[1.0, 1, 1], [1e-6, 1e3, 2.0], [3.0, 2.0, 0.0], [1e150, 1e149, 1e148]])
def test_a_stretched_rotation_is_found_again(stretch):
    turn, axes = (Rotation.from_rotvec(v).as_matrix() for v in ([0.4, -1.9, 0.8], [1.0, 0.2, -0.5]))
    matrix = turn @ axes @ np.diag(stretch) @ axes.T
    assert_allclose(rotation_of(matrix), turn, atol=1e-9)


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), np.outer([1, 2, 3], [3, 1, 2]), np.ones((3, 3))])
def test_what_has_no_definite_rotation_gives_one_that_is_best(matrix):
    rotation = rotation_of(matrix)
    assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert np.trace(rotation.T @ matrix) == pytest.approx(np.linalg.svd(matrix)[1].sum())
    assert_allclose(rotation_of(np.zeros((3, 3))), np.eye(3))
