"""Values of a parameter that are tried with ``--all`` only."""

import pytest


def slow(*values):
    return [
        pytest.param(*(value if isinstance(value, tuple) else (value,)), marks=pytest.mark.slow)
        for value in values
    ]
