"""Loaded by the server of child processes."""

import gc

import numba

import vtkmuscle.cli
import vtkmuscle.run.pool  # noqa: F401 -- children load nothing

# The first kernel of a process takes a fifth of a second longer, even one that is on disk.
numba.njit(lambda number: number)(1.0)
# As Python's documentation advises before a fork: no child searches for cycles in what is loaded.
gc.freeze()
