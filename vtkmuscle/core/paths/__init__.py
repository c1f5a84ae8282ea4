"""Muscle paths from bone to bone, taut round the bones.

The paths have the muscle's lengths and moment arms. Neither source paper has paths: Kohout and Cervenka 2021
keep the lengths of a muscle's edges, and edge lengths do not give the course of a muscle under tension. Start
reading at :mod:`~vtkmuscle.core.paths.sheet`;
:mod:`~vtkmuscle.core.paths.surroundings` describes the surroundings that hold the paths at rest,
:mod:`~vtkmuscle.core.paths.equilibrium` has the forces and Newton's method,
:mod:`~vtkmuscle.core.paths.bone_contact` and :mod:`~vtkmuscle.core.paths.ring_contact` keep paths off bones
and in via rings, :mod:`~vtkmuscle.core.paths.levers` has the paths' moment arms,
:mod:`~vtkmuscle.core.paths.poses` goes from pose to pose, and :mod:`vtkmuscle.core.skinning` takes a muscle's
surface along.
"""
