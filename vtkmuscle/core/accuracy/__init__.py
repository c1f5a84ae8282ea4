"""Errors of measured numbers: how parts combine, and what refinement says of what is left.

Open :mod:`~vtkmuscle.core.accuracy.estimate` for a number with its parts,
:mod:`~vtkmuscle.core.accuracy.convergence` for the error that two resolutions tell of,
:mod:`~vtkmuscle.core.accuracy.polylines` for that of a polyline's length.
"""
