"""Slides in metres: coordinates of a tree in the unit that other programs have."""

from __future__ import annotations

from dataclasses import replace

from vtkmuscle.core.motion.coordinates import TRANSLATIONS
from vtkmuscle.opensim.functions import Multiplier, stretched
from vtkmuscle.opensim.tree import Coupling, JointAxis, JointCoordinate, KinematicTree


def slides_in_metres(tree: KinematicTree) -> tuple[KinematicTree, dict[str, float]]:
    """Return a tree that moves as it did, with its sliding coordinates in metres.

    Parameters
    ----------
    tree : KinematicTree
        With slides in any unit.

    Returns
    -------
    tree : KinematicTree
        The same poses for values times the factors.
    factors : dict of str to float
        Of each coordinate what its unit is, in metres; 1 for angles.

    Examples
    --------
    >>> from vtkmuscle.opensim.functions import IDENTITY
    >>> from vtkmuscle.opensim.slide_units import slides_in_metres
    >>> from vtkmuscle.opensim.tree import Joint, JointAxis, JointCoordinate, KinematicTree
    >>> slide = Joint("draw", "box", "drawer", translations=[JointAxis((1, 0, 0), IDENTITY, "out")])
    >>> tree = KinematicTree("box", [slide], [JointCoordinate("out", "mm", range=(0.0, 300.0))])
    >>> metres, factors = slides_in_metres(tree)
    >>> metres.coordinates[0].range, factors
    ((0.0, 0.3), {'out': 0.001})
    """
    factors = {one.name: 1.0 if one.is_angle else TRANSLATIONS[one.unit] / 1000.0 for one in tree.coordinates}

    def of_metres(axis: JointAxis) -> JointAxis:
        if axis.coordinate is None:
            return axis
        return replace(axis, function=stretched(axis.function, factors[axis.coordinate]))

    joints = [
        replace(
            joint,
            rotations=[of_metres(axis) for axis in joint.rotations],
            translations=[of_metres(axis) for axis in joint.translations],
        )
        for joint in tree.joints
    ]
    couplings = [
        Coupling(
            one.dependent,
            one.independent,
            Multiplier(stretched(one.function, factors[one.independent]), factors[one.dependent]),
        )
        for one in tree.couplings
    ]
    coordinates = [_in_metres(one, factors[one.name]) for one in tree.coordinates]
    return replace(tree, joints=joints, coordinates=coordinates, couplings=couplings), factors


def _in_metres(one: JointCoordinate, factor: float) -> JointCoordinate:
    if one.is_angle:
        return one
    limits = None if one.range is None else (factor * one.range[0], factor * one.range[1])
    return replace(one, unit="m", rest=factor * one.rest, range=limits)
