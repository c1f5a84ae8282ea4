"""What all filters share: declared parameters and ports, failures, time.

Open :mod:`~vtkmuscle.filters.base.filter` for the class that a new filter derives from.
"""
