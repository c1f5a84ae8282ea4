import numpy as np
from numpy.testing import assert_allclose

from vtkmuscle.core.fibres.measures import filling_radius, room_between


def test_tubes_in_hexagonal_packing_fill_the_volume():
    # A lattice of lines with distance 2 r: each has a cell of 2 sqrt(3) r^2.
    assert_allclose(filling_radius(2 * np.sqrt(3) * 1.5**2 * 700.0, 700.0), 1.5)


def test_room_is_the_distance_to_the_nearest_other_line():
    x = np.linspace(0, 100, 11)
    lines = [np.column_stack([x + shift, np.full(11, y), 0 * x]) for y, shift in ((0, 0), (4, 3), (11, 0))]
    room = room_between(np.vstack(lines), np.array([0, 11, 22, 33])).reshape(3, 11)
    assert_allclose(room[0, 1:], 4, atol=1e-12)
    assert_allclose(room[1, :-1], 4, atol=1e-12)
    assert_allclose(room[2, 1:], 7, atol=1e-12)


def test_many_points_of_its_own_line_do_not_hide_a_neighbour():
    fine = np.linspace([0, 0, 0], [1, 0, 0], 500)
    other = np.array([[0, 9, 0], [1, 9, 0.0]])
    assert_allclose(room_between(np.vstack([fine, other]), np.array([0, 500, 502])), 9, atol=1e-12)


def test_one_line_has_all_the_room():
    assert np.isinf(room_between(np.zeros((4, 3)), np.array([0, 4]))).all()
