"""A muscle's surface and its fibres carried by taut paths, then settled.

:mod:`~vtkmuscle.core.skinning.carried_muscle` is the model: :mod:`~vtkmuscle.core.skinning.skinning` carries
points, :mod:`~vtkmuscle.core.skinning.settling` restores the volume and clears the bones,
:mod:`~vtkmuscle.core.skinning.diffusion` smooths. The paths are in :mod:`vtkmuscle.core.paths`.
"""
