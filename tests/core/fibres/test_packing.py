import numpy as np
from numpy.testing import assert_allclose

from vtkmuscle.core.fibres.measures import filling_radius


def test_tubes_in_hexagonal_packing_fill_the_volume():
    # A lattice of lines with distance 2 r: each has a cell of 2 sqrt(3) r^2.
    assert_allclose(filling_radius(2 * np.sqrt(3) * 1.5**2 * 700.0, 700.0), 1.5)
