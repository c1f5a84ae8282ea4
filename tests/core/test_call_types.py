"""Types of calls are remembered while kernels are compiled, and at no other time."""

import numba
import numpy as np
import pytest
from numba.core import types

from vtkmuscle.core import call_types, jit
from vtkmuscle.core.jit import array_kernel, kernel, reduction


@pytest.fixture
def looked_for(monkeypatch):
    """The calls that numba itself finds the types of; nothing is remembered at first."""
    calls = []
    find = call_types._find

    def noted(self, context, args, keywords):
        calls.append((self, args))
        return find(self, context, args, keywords)

    monkeypatch.setattr(call_types, "_find", noted)
    monkeypatch.setattr(call_types, "_found", {})
    monkeypatch.setattr(jit, "kernel_cache", lambda _: None)
    return calls


def test_a_call_is_looked_for_once(looked_for):
    @kernel
    def first(x, y):
        return x * y + x * y * x

    assert first(2.0, 3.0) == 18.0
    number = len(looked_for)
    assert number == len({(id(function), args) for function, args in looked_for}) == 2

    @kernel
    def second(x, y):
        return x * y + y * x

    assert second(2.0, 3.0) == 12.0
    assert len(looked_for) == number


def test_other_options_are_looked_for_again(looked_for):
    @kernel
    def plain(x, y):
        return min(x, y)

    @reduction
    def in_parts(x, y):
        return min(x, y)

    assert plain(1.0, 2.0) == in_parts(1.0, 2.0) == 1.0
    minima = [args for function, args in looked_for if function.key[0] is min]
    assert len(minima) == 2


def test_what_cannot_be_called_is_an_error_each_time(looked_for):
    def wrong(x):
        return x[0]

    for _ in range(2):
        with pytest.raises(numba.TypingError):
            kernel(wrong)(1.0)


def test_numba_is_as_it_was_afterwards(looked_for):
    before = types.Function.get_call_type
    assert before is not call_types._remembered

    @kernel
    def fails(x):
        return x.nothing

    with pytest.raises(numba.TypingError):
        fails(1.0)
    assert types.Function.get_call_type is before
    looked_for.clear()
    assert numba.njit(lambda x: x + x)(1.0) == 2.0
    assert not looked_for


def test_array_expressions_and_slices_are_compiled():
    @array_kernel
    def ends(values):
        return (2.0 * values + values)[1:], values[:-1] * values[1:]

    more, products = ends(np.arange(3.0))
    assert more.tolist() == [3.0, 6.0]
    assert products.tolist() == [0.0, 2.0]
