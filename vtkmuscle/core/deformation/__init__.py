"""How a muscle is deformed: carried by its paths, then settled.

Open :mod:`~vtkmuscle.core.deformation.muscle` for the model, :mod:`~vtkmuscle.core.deformation.settling` for
volume, bones and a smooth surface, :mod:`~vtkmuscle.core.deformation.diffusion` for what smooths. The paths
are in :mod:`vtkmuscle.core.paths`.
"""
