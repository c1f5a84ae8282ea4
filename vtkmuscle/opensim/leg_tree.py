"""The joints of the phantom leg."""

from __future__ import annotations

import numpy as np

from vtkmuscle.core.motion.rigid import frame_at
from vtkmuscle.joints.functions import IDENTITY
from vtkmuscle.joints.tree import Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.phantoms.leg import JOINTS, LIMITS


def leg_tree() -> KinematicTree:
    """Return the joints of :func:`vtkmuscle.phantoms.leg` in metres, as other programs take them.

    Examples
    --------
    >>> from vtkmuscle.opensim.leg_tree import leg_tree
    >>> leg_tree().bodies
    ('pelvis', 'femur', 'tibia', 'foot')
    """
    joints = []
    for name, (parent, child, centre, axis) in JOINTS.items():
        place = frame_at(np.array(centre) / 1000.0)
        turn = JointAxis(np.array(axis), IDENTITY, name)
        joints.append(Joint(f"{child}_joint", parent, child, [turn], (), place, place))
    limits = {name: (float(np.radians(low)), float(np.radians(high))) for name, (low, high) in LIMITS.items()}
    coordinates = [JointCoordinate(name, range=limits[name]) for name in JOINTS]
    return KinematicTree("pelvis", joints, coordinates)
