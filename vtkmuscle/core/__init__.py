"""Numerical kernels on plain arrays, without VTK."""
