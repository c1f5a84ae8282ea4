from __future__ import annotations

import numpy as np
import pytest

from vtkmuscle.core.mesh.sampling import space_order


@pytest.mark.parametrize("dimensions", [2, 3])
def test_neighbours_in_the_order_are_neighbours_in_space(dimensions):
    places = np.random.default_rng(0).random((4096, dimensions))
    order = space_order(places)
    np.testing.assert_array_equal(np.sort(order), np.arange(4096))

    def steps(sequence):
        return np.linalg.norm(np.diff(sequence, axis=0), axis=1).mean()

    assert steps(places[order]) < 3.0 * 4096 ** (-1 / dimensions) < 0.5 * steps(places)


def test_places_in_one_point_keep_their_order():
    assert space_order(np.ones((5, 3))).tolist() == [0, 1, 2, 3, 4]
