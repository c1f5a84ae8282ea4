"""A muscle's surface and fibres carried by taut paths.

The carried muscle then settles. :mod:`~vtkmuscle.core.skinning.carried_muscle` is the model, which restores
the volume and clears the bones: :mod:`~vtkmuscle.core.skinning.skinning` carries points,
:mod:`~vtkmuscle.core.skinning.diffusion` smooths. The paths are in :mod:`vtkmuscle.core.paths`.
"""
