"""Bows of paths that have left the bones that bent them.

A bone lets go of a path that leaves the bone, and a thin cord is then straight. The tissue of the model
(:mod:`~vtkmuscle.core.paths.surroundings`) keeps a bow. So the length of a muscle lies between the path's and
the straight line's, and the moment arm between their levers.
"""

from __future__ import annotations

import math

import numpy as np

from vtkmuscle.core.paths.neighbours import path_lengths
from vtkmuscle.core.paths.sheet import PathState
from vtkmuscle.core.types import Floats

#: Parts of the bow that the tried curves leave out. The first finds bones that the path lies on, the last
#: bones on the straight line. Two or six curves cover the same poses of phantoms.
LEFT_OUT = 0.1, 0.25, 0.5, 1.0
#: Tried paths, at most, evenly spread; all others have the mean share. Lookups deep in bones take time.
TRIED = 16


def free_shares(state: PathState, held: Floats | float = 0.0) -> Floats:
    """Return the share of each path's bow that no bone needs, (f,), beyond the shares ``held`` by tissue.

    A bone or ring that presses on a path needs its bow. Of another path a curve with less of the bow is
    shorter, but may run through bones; pushed out of the bones the curve is longer. The share is 1 for a
    curve as short as without bones, 0 for a curve as long as the path, the least of several curves.
    """
    x, contacts = state.points, state.sheet.contacts
    bows = x - np.linspace(x[:, 0], x[:, -1], x.shape[1], axis=1)
    near = contacts.proximity(state.transforms)
    tried = np.arange(len(x)) % math.ceil(len(x) / TRIED) == 0
    lengths, shares = path_lengths(x), (tried & (state.contacts == 0)).astype(np.float64)
    for part in LEFT_OUT:
        if not (free := shares > held).any():
            break
        near.gaps.reshape(-1, *x.shape[:2])[:, ~free] = np.inf  # not looked up
        curves = x - part * free[:, None, None] * bows
        contacts.update(curves, near)
        pushes = (np.maximum(-near.gaps, 0.0)[..., None] * near.normals).sum(axis=0).reshape(x.shape)
        pushes[:, [0, -1]] = 0.0
        shorter = np.maximum(lengths - path_lengths(curves), np.finfo(float).eps * lengths)
        shares = np.clip((lengths - path_lengths(curves + pushes)) / shorter, 0.0, shares)
    shares = np.maximum(shares - held, 0.0)
    return np.asarray(np.where(tried, shares, shares[tried].mean()))
