"""Round closed muscles about a curve: their harmonic function and the lengths of their fibres are known."""

import numpy as np

from vtkmuscle.phantoms.meshing import solid_of_revolution

SIDES = 24


def bent_tube(path, radius):
    """Return points and triangles of a tube about a curve in the plane y = 0, and its end discs' points."""
    tangents = np.gradient(path, axis=0, edge_order=2)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    across = np.cross([0.0, 1.0, 0.0], tangents)
    straight, triangles = solid_of_revolution(np.arange(len(path)), np.full(len(path), radius), SIDES)
    row = straight[:, 2].astype(int)
    points = path[row] + straight[:, :1] * across[row] + straight[:, 1:2] * [0.0, 1.0, 0.0]
    return points, triangles, *(np.flatnonzero(row == end) for end in (0, len(path) - 1))


def half_circle(radius=60.0, n=80):
    """Return a curve that turns by 180 degrees about the y axis."""
    angle = np.linspace(0, np.pi, n)
    return radius * np.column_stack([np.cos(angle), np.zeros(n), np.sin(angle)])


def letter_s(radius=50.0, n=80):
    """Return two half circles that bend to opposite sides, about (-radius, 0, 0) and (radius, 0, 0)."""
    angle = np.linspace(0, np.pi, n)
    first = np.column_stack([-np.cos(angle) - 1, np.zeros(n), np.sin(angle)])
    second = np.column_stack([1 - np.cos(angle), np.zeros(n), -np.sin(angle)])
    return radius * np.vstack([first, second[1:]])
