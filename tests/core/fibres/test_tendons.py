import numpy as np
import pytest

from vtkmuscle.core.fibres.embedding import Tendons

X = np.linspace(0.0, 100.0, 21)


def sheet(shape):
    """Return six paths beside each other, from 0 to 100 mm along x, with what a function adds to z."""
    return np.array([np.column_stack([X, np.full(21, y), shape(X)]) for y in np.arange(6.0) * 2.0])


@pytest.fixture
def fibres(rng):
    ends = rng.uniform(
        [[20.0, 2.0, -3.0], [60.0, 2.0, 3.0]], [[40.0, 8.0, -1.0], [80.0, 8.0, 5.0]], (30, 2, 3)
    )
    share = np.linspace(0.0, 1.0, 9)[:, None]
    return (1.0 - share) * ends[:, :1] + share * ends[:, 1:]


def free(fibres):
    return np.zeros((len(fibres), 2), dtype=bool)


def test_a_rigid_motion_is_followed_and_at_rest_nothing_moves(fibres):
    rest = sheet(lambda x: 5.0 * np.sin(x / 30.0))
    tendons = Tendons(fibres, rest, free(fibres))
    assert np.allclose(tendons.placed(fibres, rest), fibres)
    c, s = np.cos(0.7), np.sin(0.7)
    turn, shift = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]), np.array([9.0, -4.0, 30.0])
    # The offset turns with its path, about the axis across the sheet.
    assert np.allclose(
        tendons.placed(fibres @ turn.T + shift, rest @ turn.T + shift), fibres @ turn.T + shift
    )


def test_what_is_bent_at_rest_keeps_the_bow_that_it_was_carried_with(fibres):
    rest, bent = sheet(np.zeros_like), fibres.copy()
    bent[:5, 4, 2] += 1.0
    held = Tendons(bent, rest, free(bent)).placed(bent * [0.8, 1.0, 1.0], rest * [0.8, 1.0, 1.0])
    middle = held[:, 4, 2] - (held[:, 0, 2] + held[:, -1, 2]) / 2.0
    assert np.allclose(middle[:5], 1.0)
    assert np.allclose(middle[5:], 0.0)
