"""What all filters share: declared parameters and ports, failures, time.

Open :mod:`~vtkmuscle.filters.base.filter` for the class that a new filter derives from, and
:mod:`~vtkmuscle.filters.base.history` for filters whose result at a time depends on those before.
"""
