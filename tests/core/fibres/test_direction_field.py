import numpy as np
import pytest
from phantoms.winding_spindle import winding_fibre, winding_fibres

from vtkmuscle.core.fibres.direction_field import NEIGHBOURS, DirectionField
from vtkmuscle.core.mesh.polylines import segment_distances
from vtkmuscle.core.pbd.sweep import fibre_directions_at


def lines_of(fibres):
    """Return points and offsets of a list of fibres."""
    return np.vstack(fibres), np.concatenate([[0], np.cumsum([len(one) for one in fibres])])


def angles(u, v):
    """Return the angles between axes [degrees]."""
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(u, v), axis=-1), np.abs((u * v).sum(axis=-1))))


def in_spindle(rng, count):
    """Return positions in the winding spindle."""
    t, part, start = (
        rng.uniform(0.02, 0.98, count),
        np.sqrt(rng.uniform(0, 0.95, count)),
        rng.uniform(0, 6, count),
    )
    places = zip(t, part, start, strict=True)
    return np.vstack([winding_fibre(q, a, 90.0, np.array([x])) for x, q, a in places])


def straight(rng, count, spread=30.0):
    """Return straight fibres of one to twenty segments, in directions that differ."""
    starts = rng.uniform(0, spread, (count, 3))
    ends = starts + np.array([0, 0, 60.0]) + rng.uniform(-20, 20, (count, 3))
    return [
        a + np.linspace(0, 1, rng.integers(2, 21))[:, None] * (b - a)
        for a, b in zip(starts, ends, strict=True)
    ]


def test_parallel_fibres_have_one_direction_everywhere(rng):
    way = np.array([2.0, -3.0, 6.0]) / 7.0
    fibres = [start + np.linspace(0, 50, 9)[:, None] * way for start in rng.uniform(0, 20, (30, 3))]
    directions, _ = DirectionField(*lines_of(fibres)).at(rng.uniform(-40, 60, (500, 3)))
    assert np.abs(directions - way).max() < 1e-12


def test_it_is_the_mean_that_its_words_say(rng):
    """The sum over all fibres, written down again without a search, of straight fibres cut anyhow."""
    fibres, positions = straight(rng, 40), rng.uniform(-10, 70, (300, 3))
    found, distances = DirectionField(*lines_of(fibres)).at(positions)
    ways = np.array([fibre[-1] - fibre[0] for fibre in fibres])
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    for position, direction, distance in zip(positions, found, distances, strict=True):
        all_of_them = np.array([segment_distances(position, fibre[0], fibre[-1]) for fibre in fibres])
        order = np.argsort(all_of_them)
        d, end = all_of_them[order[:NEIGHBOURS]], all_of_them[order[NEIGHBOURS]]
        weights = ((end - d) / (end * d)) ** 2
        tensor = sum(w * np.outer(u, u) for w, u in zip(weights, ways[order], strict=False))
        assert angles(direction, np.linalg.eigh(tensor)[1][:, -1]) < 0.01
        assert direction @ (weights[:, None] * ways[order[:NEIGHBOURS]]).sum(axis=0) > 0
        assert distance == pytest.approx(d[0], abs=1e-9)


def test_on_a_fibre_it_is_its_tangent():
    fibres = winding_fibres(60, points=200)
    for fibre in (fibres[5], fibres[40]):
        directions, distances = DirectionField(*lines_of(fibres)).at(fibre[1:-1])
        assert angles(directions, (fibre[2:] - fibre[:-2])).max() < 0.01
        assert distances.max() < 1e-9


def test_it_does_not_jump_where_another_fibre_comes_nearest(rng):
    lines = lines_of(straight(rng, 60))
    way = rng.uniform(5, 25, (1, 3)) + np.linspace(0, 1, 20001)[:, None] * np.array([20.0, 15.0, 40.0])
    directions, _ = DirectionField(*lines).at(way)
    assert angles(directions[1:], directions[:-1]).max() < 0.2
    nearest = fibre_directions_at(way[::20], *lines)
    assert angles(nearest[1:], nearest[:-1]).max() > 5.0


def test_fibres_that_run_the_other_way_change_no_axis(rng):
    fibres = winding_fibres(80)
    turned = [
        fibre[::-1] if flip else fibre for fibre, flip in zip(fibres, rng.random(80) < 0.3, strict=True)
    ]
    positions = in_spindle(rng, 300)
    one, other = (DirectionField(*lines_of(each)).at(positions)[0] for each in (fibres, turned))
    assert angles(one, other).max() < 1e-6
    assert (one[:, 2] > 0).all()


def test_a_single_fibre_and_fibres_equally_far():
    line = np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, 1], [0, 1, 2]])
    field = DirectionField(*lines_of([line, np.zeros((2, 3))]))
    directions, distances = field.at(np.array([[1.0, 0, 0.5], [0, 3, 4]]))
    assert distances == pytest.approx([1.0, 8**0.5])
    assert angles(directions[1], np.array([0, 1, 1.0])) < 1e-6
    assert field.spacing == np.inf
    turns = 2 * np.pi * np.arange(2 * NEIGHBOURS) / (2 * NEIGHBOURS)
    up = np.array([0.0, 0.0, 1.0])
    ring = np.column_stack([np.cos(turns), np.sin(turns), 0 * turns])
    field = DirectionField(*lines_of([np.array([one - up, one + up]) for one in ring]))
    assert np.allclose(field.at(np.zeros((1, 3)))[0], [[0, 0, 1]])
    assert field.spacing == pytest.approx(2 * np.sin(np.pi / (2 * NEIGHBOURS)))


def test_fibres_without_length_are_an_error():
    with pytest.raises(ValueError, match="all fibres have length 0"):
        DirectionField(np.zeros((3, 3)), np.array([0, 3]))
