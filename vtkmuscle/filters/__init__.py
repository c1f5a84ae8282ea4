"""VTK filters over :mod:`vtkmuscle.core`: one algorithm per file."""
