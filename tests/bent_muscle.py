"""Round closed muscles about a curve: their harmonic function and the lengths of their fibres are known."""

from itertools import pairwise

import numpy as np

SIDES = 24


def bent_tube(path, radius):
    """Return points and triangles of a tube about a curve in the plane y = 0, and its end discs' points."""
    j = np.arange(SIDES)
    turn = 2 * np.pi * j / SIDES
    tangents = np.gradient(path, axis=0, edge_order=2)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    across = np.cross([0.0, 1.0, 0.0], tangents)
    around = np.cos(turn)[:, None] * across[:, None] + np.sin(turn)[:, None] * np.array([0.0, 1.0, 0.0])
    rings = [centre + radius * directions for centre, directions in zip(path, around, strict=True)]
    triangles = []

    def bridge(one, other):
        triangles.extend([np.column_stack([one, np.roll(one, -1), other])])
        triangles.extend([np.column_stack([np.roll(one, -1), np.roll(other, -1), other])])

    points = list(rings)
    ids = [i * SIDES + j for i in range(len(path))]
    for one, other in pairwise(ids):
        bridge(one, other)
    discs = []
    for end in (0, -1):
        members = [ids[end]]
        for share in (0.75, 0.5, 0.25):
            points.append(path[end] + share * (rings[end] - path[end]))
            members.append(len(points) * SIDES - SIDES + j)
            bridge(*(members[-2:] if end else members[:-3:-1]))
        discs.append(members)
    n = len(points) * SIDES
    for k, members in enumerate(discs):
        inner = members[-1] if k else members[-1][::-1]
        triangles.append(np.column_stack([inner, np.roll(inner, -1), np.full(SIDES, n + k)]))
    points = np.vstack([*points, path[:1], path[-1:]])
    patches = [np.append(np.concatenate(members), n + k) for k, members in enumerate(discs)]
    return points, np.vstack(triangles), *patches


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
