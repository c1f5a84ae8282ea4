"""The paths of a muscle: from bone to bone, taut, one sheet round the bones.

They have its lengths and moment arms. Neither of the two papers has this: Kohout and Cervenka 2021 keep the
lengths of a muscle's edges, which says nothing of the way that a muscle under tension takes. Start reading at
:mod:`~vtkmuscle.core.paths.sheet`;
:mod:`~vtkmuscle.core.paths.surroundings` says what lies round the paths at rest and holds them,
:mod:`~vtkmuscle.core.paths.equilibrium` has the forces and Newton's method,
:mod:`~vtkmuscle.core.paths.bone_contact` and :mod:`~vtkmuscle.core.paths.ring_contact` keep paths off bones
and in via rings, :mod:`~vtkmuscle.core.paths.levers` has their moment arms,
:mod:`~vtkmuscle.core.paths.poses` goes from pose to pose, and :mod:`vtkmuscle.core.skinning` takes a muscle's
surface along.
"""
