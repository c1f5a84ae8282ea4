"""What is made from a surface once for all who hold it."""

import gc

import numpy as np
from shapes import ball

from vtkmuscle.core.mesh.shared import keep_shared, shared


class Made:
    """Something made from a surface."""

    def __init__(self, points, triangles):
        self.points, self.triangles = points, triangles


def counted():
    made = []

    def make(points, triangles):
        made.append(len(points))
        return Made(points, triangles)

    return shared(make), made


def test_a_surface_is_worked_on_once_while_somebody_holds_the_result():
    ask, made = counted()
    points, triangles = ball()
    first = ask(points, triangles)
    assert ask(points.copy(), triangles.copy()) is first
    assert ask(points + 1.0, triangles) is not first
    assert len(made) == 2


def test_within_held_it_is_kept_though_the_one_who_asked_is_gone():
    ask, made = counted()
    with keep_shared():
        ask(*ball())
        with keep_shared():
            gc.collect()
        gc.collect()
        ask(*ball())
        assert len(made) == 1
    gc.collect()
    ask(*ball())
    assert len(made) == 2


def test_what_was_made_does_not_follow_an_array_that_its_owner_changes():
    ask, _ = counted()
    points, triangles = ball()
    before, known = points.copy(), ask(points, triangles)
    points += 1.0
    np.testing.assert_array_equal(known.points, before)
    assert ask(before, triangles) is known
