"""What kernels are compiled with."""

import numpy as np

from vtkmuscle.core import jit


def test_a_kernel_of_views_gives_what_python_gives():
    def last_of_each(table):
        total = 0.0
        for i in range(len(table)):
            row = table[i]
            total += row[len(row) - 1]
        return total

    table = np.arange(12.0).reshape(3, 4)
    assert jit.kernel(last_of_each)(table) == last_of_each(table)


def test_a_kernel_is_compiled_alike_whichever_calls_it_first():
    """Its machine code is kept for all callers: their options must not decide its last digits."""
    inner = jit.kernel(lambda a, b, c: a * b + c)
    outer = jit.vector_kernel(lambda a, b, c: inner(a, b, c) * a + b)
    outer(1.0, 2.0, 3.0)
    (signature,) = inner.signatures
    assert "contract" in outer.inspect_llvm(outer.signatures[0])
    assert "contract" not in inner.inspect_llvm(signature)
