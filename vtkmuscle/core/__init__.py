"""The mathematics of vtkmuscle: numpy, numba and scipy on plain arrays.

Nothing here knows what a VTK pipeline is; every function takes and returns arrays and can be read and
tested on its own.
"""
