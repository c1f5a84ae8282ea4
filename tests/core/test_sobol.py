"""Sobol's sequence is the one that SciPy has."""

import numpy as np
import pytest
from scipy.stats import qmc

from vtkmuscle.core.mesh.sampling import sobol


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize(("exponent", "first"), [(0, 0), (4, 0), (11, 0), (5, 96), (9, 2**20)])
def test_numbers_are_those_of_scipy(dimension, exponent, first):
    sequence = qmc.Sobol(dimension, scramble=False)
    if first:
        sequence.fast_forward(first)
    assert np.array_equal(sobol(2**exponent, dimension, first=first), sequence.random(2**exponent))


def test_no_points_are_none():
    assert sobol(0, 2).shape == (0, 2)
