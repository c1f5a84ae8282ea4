"""Errors of measured numbers: how parts combine, and what refinement says of what is left.

Open :mod:`~vtkmuscle.core.accuracy.estimate`.
"""
