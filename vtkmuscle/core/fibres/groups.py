"""Fibres by groups that lengthen alike."""

from __future__ import annotations

import numpy as np
from scipy.cluster.vq import kmeans2

from vtkmuscle.core.types import Floats, Ints


def group_fibres(lengths: Floats, count: int) -> Ints:
    """Return the group of each fibre (n,), of fibres that lengthen alike.

    k-means of the lengths' changes from their means over the poses: fibres of one group have the same moment
    arms, whatever their lengths are.

    Parameters
    ----------
    lengths : (f, n) array
        Of each fibre in each pose.
    count : int
        Number of groups; fewer come out where fibres are fewer, or are alike.
    """
    changes = (lengths - lengths.mean(axis=0)).T
    distinct = len(np.unique(changes.round(12), axis=0))
    count = max(1, min(count, distinct))
    if count == 1:
        return np.zeros(len(changes), dtype=np.int64)
    _, labels = kmeans2(changes, count, minit="++", rng=np.random.default_rng(0), missing="warn")
    # Groups by their first fibre, without those that came out empty.
    _, first, plain = np.unique(labels, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first))
    groups: Ints = rank[plain].astype(np.int64)
    return groups


def group_errors(lengths: Floats, groups: Ints) -> Floats:
    """Return the RMS (n,) of each fibre's change of length against that of its group, in its unit."""
    changes = lengths - lengths.mean(axis=0)
    errors = np.zeros(lengths.shape[1])
    for group in range(int(groups.max()) + 1):
        mine = groups == group
        off = changes[:, mine] - changes[:, mine].mean(axis=1, keepdims=True)
        errors[mine] = np.sqrt((off**2).mean(axis=0))
    return errors
