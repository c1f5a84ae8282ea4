"""Bows of paths that have left the bones that bent them.

A bone lets go of a path that leaves the bone, and a thin cord is then straight. The tissue of the model
(:mod:`~vtkmuscle.core.paths.surroundings`) keeps a bow. So the length of a muscle lies between the path's and
the straight line's, and the moment arm between their levers.
"""

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
    all_held = np.zeros(len(state.points)) + held
    tried = np.arange(0, len(all_held), math.ceil(len(all_held) / TRIED))
    x, contacts, least = state.points[tried], state.sheet.contacts.of_paths(tried), all_held[tried]
    bows, near = x - np.linspace(x[:, 0], x[:, -1], x.shape[1], axis=1), contacts.proximity(state.transforms)
    lengths, shares = path_lengths(x), (state.contacts[tried] == 0).astype(np.float64)
    for part in LEFT_OUT:
        if not (free := shares > least).any():
            break
        near.gaps.reshape(-1, *x.shape[:2])[:, ~free] = np.inf  # not looked up
        curves = x - part * free[:, None, None] * bows
        contacts.update(curves, near)
        pushes = (np.maximum(-near.gaps, 0.0)[..., None] * near.normals).sum(axis=0).reshape(x.shape)
        pushes[:, [0, -1]] = 0.0
        shorter = np.maximum(lengths - path_lengths(curves), np.finfo(float).eps * lengths)
        shares = np.clip((lengths - path_lengths(curves + pushes)) / shorter, 0.0, shares)
    shares = np.maximum(shares - least, 0.0)
    all_shares = np.full(len(all_held), shares.mean())
    all_shares[tried] = shares
    return all_shares
