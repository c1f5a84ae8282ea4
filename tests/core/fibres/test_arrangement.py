import numpy as np
import pytest

from vtkmuscle.core.fibres.measures import arrangement
from vtkmuscle.core.mesh.polylines import sharp_turns

#: A sheet of 10 x 4 fibres, 2 mm from each other and 60 mm long, in the middle of what it fills.
X, Y, Z = np.arange(10.0) * 2.0, np.arange(4.0) * 2.0, np.linspace(0.0, 60.0, 31)


def sheet():
    x, y, z = np.meshgrid(X, Y, Z, indexing="ij")
    return np.stack([x, y, z], axis=-1).reshape(40, 31, 3)


def inside(rng, low=(-1.0, -1.0, 0.0), high=(19.0, 7.0, 60.0)):
    return rng.uniform(low, high, (4000, 3))


def found(lines, samples):
    offsets, volume = np.arange(len(lines) + 1) * lines.shape[1], np.prod(np.ptp(samples, axis=0))
    return arrangement(lines.reshape(-1, 3), offsets, samples, volume)


def test_straight_fibres_neither_cross_nor_turn_and_leave_nothing_bare(rng):
    good = found(sheet(), inside(rng))
    assert (good.crossing, good.hooked, good.bare) == (0.0, 0.0, 0.0)
    assert good.turning == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("end", ["origin", "insertion"])
def test_fibres_that_change_over_to_the_other_edge_cross(rng, end):
    lines = sheet()
    share = np.clip((Z - 54.0) / 6.0, 0.0, 1.0)
    lines[..., 0] += share * (18.0 - 2.0 * lines[..., 0])
    lines[..., 1] += share * (6.0 - 2.0 * lines[..., 1])
    if end == "origin":
        lines = lines[:, ::-1]
    assert found(lines, inside(rng)).crossing > 0.9


def test_fibres_that_run_together_or_wind_do_not_cross(rng):
    lines = sheet() - [9.0, 3.0, 0.0]
    tip = lines.copy()
    tip[..., :2] *= (1.0 - 0.95 * Z / 60.0)[:, None]
    assert found(tip, inside(rng)).crossing < 0.02
    angle = np.pi * Z / 60.0
    x, y = lines[..., 0].copy(), lines[..., 1].copy()
    lines[..., 0] = np.cos(angle) * x - np.sin(angle) * y
    lines[..., 1] = np.sin(angle) * x + np.cos(angle) * y
    assert found(lines, inside(rng)).crossing == 0.0


def test_hooks_and_turns_are_counted(rng):
    lines = sheet()
    lines[:10, -1] = lines[:10, -2] - [0.5, 0.0, 1.0]
    assert found(lines, inside(rng)).hooked == 0.25
    turn = np.pi * Z / 60.0
    bend = np.column_stack([30.0 * np.cos(turn), 0 * turn, 30.0 * np.sin(turn)])
    arcs = bend + np.arange(6.0)[:, None, None] * [0.0, 2.0, 0.0]
    assert found(arcs, inside(rng)).turning == pytest.approx(180.0 * 29 / 30, rel=1e-6)


def test_a_half_without_fibres_is_bare(rng):
    assert found(sheet(), inside(rng, high=(39.0, 7.0, 60.0))).bare == pytest.approx(0.45, abs=0.03)


def test_a_path_that_hooks_turns_sharply_and_an_arc_does_not():
    turn = np.pi * np.linspace(0.0, 1.0, 31)
    arc = 60.0 * np.column_stack([np.cos(turn), 0.0 * turn, np.sin(turn)])
    hook = np.vstack(
        [np.linspace([0.0, 0, 0], [0, 0, 80], 21)[:-1], np.linspace([0.0, 0, 80], [40, 0, 80], 11)]
    )
    for size in (1 / 30, 1.0, 30.0):
        path, position, reach = sharp_turns(size * np.array([arc, hook]))
        assert set(path) == {1}
        assert np.linalg.norm(position - size * np.array([0.0, 0.0, 80.0]), axis=1).max() < 12.0 * size
        assert reach == pytest.approx(6.0 * size)


def test_few_fibres_are_no_reason():
    for count in (1, 2, 4):
        few = found(sheet()[:count], np.zeros((1, 3)))
        assert (few.crossing, few.hooked, few.bare) == (0.0, 0.0, 0.0)
