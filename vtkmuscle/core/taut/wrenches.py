"""What paths of unit tension do to the bones that hold them."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.mesh.normals import unit_vectors
from vtkmuscle.core.taut.via_rings import ViaRing, in_ring_plane
from vtkmuscle.core.types import Bools, Floats, Ints


def path_wrenches(points: Floats, shares: Floats) -> Floats:
    """Return the force and moment that paths of unit tension exert on the bones that hold their points.

    At its ends a path pulls along its first and last segment; where it bends, the two segments at a point
    press it on what holds it there. All forces on a path's bones together are none, and so are all moments.

    Parameters
    ----------
    points : (f, n, 3) array
        Of the paths [mm].
    shares : (b, f, n) array
        Part of each point that each bone holds; they sum to 1 over the bones.

    Returns
    -------
    (f, b, 6) array
        Force [1] and moment about the origin [mm] on each bone.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.core.taut.wrenches import path_wrenches
    >>> straight = np.array([[[0.0, 30.0, 0.0], [50.0, 30.0, 0.0], [100.0, 30.0, 0.0]]])
    >>> ends = np.array([[[1.0, 0.5, 0.0]], [[0.0, 0.5, 1.0]]])
    >>> path_wrenches(straight, ends)[0, 0]
    array([  1.,   0.,   0.,   0.,   0., -30.])
    """
    along = unit_vectors(np.diff(points, axis=1))
    pulls = np.zeros_like(points)
    pulls[:, :-1] += along
    pulls[:, 1:] -= along
    wrenches = np.concatenate([pulls, np.cross(points, pulls)], axis=2)
    on_bones: Floats = np.einsum("bfn,fni->fbi", shares, wrenches)
    return on_bones


def near_bones(distances: Floats) -> Floats:
    """Return parts (b, f, n), which sum to 1 over bones, by inverse squares of distances (Shepard 1968)."""
    least = np.finfo(float).eps * max(float(distances.max(initial=0.0)), 1.0)
    near = 1.0 / np.maximum(distances, least) ** 2
    parts: Floats = near / near.sum(axis=0)
    return parts


def shares_of_bones(near: Floats, pushed: Bools) -> Floats:
    """Return what part of each point each bone holds, (b, f, n).

    Those that push it, alike; where none does, what bends a string goes with the bones by how near they are.
    """
    count = pushed.sum(axis=0)
    shares: Floats = np.where(count > 0, pushed / np.maximum(count, 1), near)
    return shares


def give_to_ring(shares: Floats, points: Floats, bone: int, ring: ViaRing) -> None:
    """Let a bone hold the point next to the plane of its via ring, of all strings that go through that."""
    heights = in_ring_plane(ring, points.reshape(-1, 3))[1].reshape(points.shape[:2])
    through = np.flatnonzero((heights.min(axis=1) < 0.0) & (heights.max(axis=1) > 0.0))
    at = np.abs(heights[through, 1:-1]).argmin(axis=1) + 1
    shares[:, through, at] = 0.0
    shares[bone, through, at] = 1.0


def give_ends(shares: Floats, first: Ints, last: Ints) -> None:
    """Let bones (f,) hold the ends of strings."""
    for bones, end in ((first, 0), (last, -1)):
        shares[:, :, end] = 0.0
        shares[bones, np.arange(len(bones)), end] = 1.0
