"""Kernels that kernels call are compiled as parts of these, without machine code of their own."""

import numba
import numpy as np
import pytest

from vtkmuscle.core import jit
from vtkmuscle.core.jit import array_kernel, kernel, lane, reduction
from vtkmuscle.core.kernel_parts import KernelLibrary, PartLibrary


@kernel
def _square(x):
    return x * x


@lane
def _twice(x):
    return x + x


@array_kernel
def _squares(values):
    result = np.empty(len(values))
    for i in range(len(values)):
        result[i] = _square(values[i])
    return result


@reduction
def _total(values):
    total = 0.0
    for value in _squares(values):
        total += _twice(value) + _square(2)
    return total


VALUES = np.array([1.0, 2.0, 3.0])


@pytest.fixture
def compiled():
    """The functions that are compiled, as they are done."""
    found = []

    class Listener(numba.core.event.Listener):
        def on_start(self, event):
            pass

        def on_end(self, event):
            found.append(event.data["dispatcher"])

    with numba.core.event.install_listener("numba:compile", Listener()):
        yield found


def test_a_kernel_of_parts_of_parts_is_right():
    assert _total(VALUES) == pytest.approx(2 * 14.0 + 3 * 4.0)


def test_python_can_call_what_kernels_call_too():
    assert _squares(VALUES).tolist() == [1.0, 4.0, 9.0]
    assert _square(3.0) == 9.0
    assert _square(3) == 9


def test_parts_have_no_machine_code_and_are_compiled_once(compiled):
    @kernel
    def inner(x):
        return 2.0 * x

    @kernel
    def outer(x):
        return inner(x) + inner(inner(x))

    assert outer(1.0) == 6.0
    assert [one.py_func.__name__ for one in compiled] == ["inner", "outer"]
    libraries = [result.library for one in compiled for result in one.overloads.values()]
    assert [isinstance(library, PartLibrary) for library in libraries] == [True, False]
    assert not inner.overloads
    assert inner(2.0) == 4.0


def test_a_constant_does_not_compile_a_part_again(compiled):
    @kernel
    def shifted(x, by):
        return x + by

    @kernel
    def both(x):
        return shifted(x, 1) + shifted(x, 2)

    assert both(0.0) == 3.0
    assert [one.py_func.__name__ for one in compiled] == ["shifted", "both"]


def test_sums_as_written_are_optimised_once_and_others_as_numba_does(monkeypatch):
    monkeypatch.setattr(jit, "kernel_cache", lambda _: None)

    def total(values):
        result = 0.0
        for value in values:
            result += value
        return result

    as_written, in_parts = kernel(total), reduction(total)
    assert as_written(VALUES) == in_parts(VALUES) == 6.0
    (written,), (parts,) = as_written.overloads.values(), in_parts.overloads.values()
    assert isinstance(written.library, KernelLibrary)
    assert not isinstance(parts.library, KernelLibrary)


def test_an_error_in_a_part_is_raised():
    @kernel
    def root(x):
        if x < 0.0:
            raise ValueError("x must not be negative")
        return x**0.5

    @kernel
    def twice_root(x):
        return 2.0 * root(x)

    assert twice_root(4.0) == 4.0
    with pytest.raises(ValueError, match="x must not be negative"):
        twice_root(-1.0)
