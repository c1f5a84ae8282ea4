"""Fibres that slide off a bone sideways: which bone, and how far in one step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vtkmuscle.core.bones.bone import Bone
from vtkmuscle.core.moment_arms.length_jumps import even_stretches, largest_turns, length_jumps
from vtkmuscle.core.motion.rigid import RigidMotion, apply_transform, inverse
from vtkmuscle.core.types import Floats

#: A point of a fibre lies on a bone where nothing but muscle is between them: nearer than this [mm].
ON_BONE = 12.0
#: Parts of a fibre beside its ends, which are attached, that are not looked at.
ENDS = 0.15


def slides_of(
    lengths: Floats,
    lines: Sequence[Floats],
    motion: RigidMotion,
    shapes: Mapping[str, Bone],
    *,
    jump: float,
    millimetres: float = 1.0,
) -> list[tuple[float, str] | None]:
    """Return how far the fibre whose length jumps most has slid aside on a bone, frame by frame.

    Parameters
    ----------
    lengths : (f, k) array
        Of the fibres in each frame [mm].
    lines : sequence of (k, n, 3) array
        Their points in each frame, in the scene's unit.
    motion : RigidMotion
        At the times of the frames.
    shapes : mapping of str to Bone
        The bones at rest.
    jump : float
        Only steps in which a length jumps by more than this are looked at [mm].
    millimetres : float, optional
        Of the scene's unit.

    Returns
    -------
    list of (float, str) or None
        Per frame millimetres since the frame before, and the bone; None where nothing jumps, or the fibre lay
        on no bone.
    """
    found: list[tuple[float, str] | None] = [None] * len(lengths)
    jumps = length_jumps(lengths, motion.times, even_stretches(motion), largest_turns(motion))
    for step in np.flatnonzero(jumps.max(axis=1, initial=0.0) > jump).tolist():
        fibre = int(jumps[step].argmax())
        before, after = (motion.at(time) for time in motion.times[step : step + 2])
        slid = {}
        for bone, shape in shapes.items():
            here = apply_transform(inverse(before.get(bone, np.eye(4))), lines[step][fibre])
            there = apply_transform(inverse(after.get(bone, np.eye(4))), lines[step + 1][fibre])
            slid[bone] = millimetres * _aside(here, there, shape, ON_BONE / millimetres)
        if slid and max(slid.values()) > 0.0:
            bone = max(slid, key=lambda name: slid[name])
            found[step + 1] = slid[bone], bone
    return found


def _aside(before: Floats, after: Floats, shape: Bone, near: float) -> float:
    """Return how far points (n, 3) that lie on a bone move across their line and along the bone.

    Both are in the frame of the bone. What moves along the line slides as it may, what moves off lifts.
    """
    skip = int(np.ceil(ENDS * len(before)))
    inner = slice(skip, len(before) - skip)
    low, high = shape.box
    places = before[inner]
    if ((places < low - near) | (places > high + near)).any(axis=1).all():
        return 0.0
    apart, outward = shape.exact(places)
    on = (np.abs(apart) < near) & (apart != 0.0)
    if not on.any():
        return 0.0
    along = np.gradient(before, axis=0)[inner][on]
    aside = np.cross(along, outward[on])
    sizes = np.linalg.norm(aside, axis=1)
    moved = (after[inner] - places)[on]
    steps = np.abs(np.einsum("ij,ij->i", moved, aside)) / np.maximum(sizes, 1e-300)
    return float(steps[sizes > 0.0].max(initial=0.0))
