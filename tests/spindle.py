"""A small closed muscle for tests: a spindle along z, fixed to bone 0 below and bone 1 above."""

import numpy as np


def spindle(rings=12, around=10, length=100.0, radius=15.0, seed=None):
    """Return points, triangles and fixed_to; a seed roughens the surface so that nothing is symmetric."""
    height = np.linspace(0, np.pi, rings + 2)[1:-1]
    turn = np.arange(around) * 2 * np.pi / around
    r = radius * (0.3 + 0.7 * np.sin(height))[:, None]
    z = np.repeat((-np.cos(height) * length / 2)[:, None], around, axis=1)
    body = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=2).reshape(-1, 3)
    points = np.vstack([body, [[0, 0, -length / 2], [0, 0, length / 2]]])
    if seed is not None:
        points += np.random.default_rng(seed).normal(scale=0.08 * radius, size=points.shape)
    i, j = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    c, d = a + around, b + around
    j = np.arange(around)
    last = (rings - 1) * around
    triangles = np.vstack(
        [
            np.stack([a, b, c], axis=2).reshape(-1, 3),
            np.stack([b, d, c], axis=2).reshape(-1, 3),
            np.column_stack([(j + 1) % around, j, np.full(around, len(body))]),
            np.column_stack([last + j, last + (j + 1) % around, np.full(around, len(body) + 1)]),
        ]
    )
    fixed_to = np.full(len(points), -1)
    fixed_to[np.r_[: 2 * around, len(body)]] = 0
    fixed_to[np.r_[last - around : len(body), len(body) + 1]] = 1
    return points, triangles, fixed_to
