"""Rigid motions of bones: transforms over time, their coordinates, and transforms in between.

Open :mod:`~vtkmuscle.core.motion.rigid` for a motion, :mod:`~vtkmuscle.core.motion.coordinates` for joints'
coordinates, and :mod:`~vtkmuscle.core.motion.blending` for dual quaternion blending (Kavan et al. 2008), by
which a step starts.
"""
