import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vtkmuscle.core.pbd.colouring import greedy_colouring


def first_fit(constraints, n):
    seen = [set() for _ in range(n)]
    colours = []
    for row in constraints:
        taken = set().union(*(seen[p] for p in row if p < n))
        colour = next(c for c in range(len(constraints) + 1) if c not in taken)
        for p in row:
            if p < n:
                seen[p].add(colour)
        colours.append(colour)
    return colours


def clashes(constraints, colours, n):
    """Return the pairs of constraints of one colour that share a point."""
    seen = set()
    count = 0
    for row, colour in zip(constraints, colours, strict=True):
        for p in set(row.tolist()):
            if p < n:
                count += (p, colour) in seen
                seen.add((p, colour))
    return count


@given(st.integers(2, 30), st.integers(1, 4), st.integers(0, 60), st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=40)
def test_colours_are_those_of_first_fit(n, k, m, seed):
    constraints = np.random.default_rng(seed).integers(0, n + 2, size=(m, k))
    colours = greedy_colouring(constraints, n)
    assert colours.tolist() == first_fit(constraints, n)


def test_a_point_of_many_constraints_runs_out_of_bits_but_not_of_colours():
    """Two hubs of 300 spokes each, and edges between the spokes."""
    spokes = np.arange(300)
    constraints = np.vstack(
        [
            np.column_stack([np.full(300, 300), spokes]),
            np.column_stack([np.full(300, 301), spokes]),
            np.column_stack([spokes, np.roll(spokes, 1)]),
        ]
    )
    colours = greedy_colouring(constraints, 302)
    assert clashes(constraints, colours, 302) == 0
    assert colours.max() < 2 * 304


def test_blocks_have_colours_of_their_own_in_their_order(rng):
    constraints = rng.integers(0, 50, size=(200, 2))
    colours = greedy_colouring(constraints, 50, block=40)
    assert clashes(constraints, colours, 50) == 0
    blocks = colours.reshape(5, 40)
    assert (blocks.max(axis=1)[:-1] < blocks.min(axis=1)[1:]).all()


def test_nothing_to_colour():
    assert greedy_colouring(np.empty((0, 2), dtype=np.int64), 0).shape == (0,)
