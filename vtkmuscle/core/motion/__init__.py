"""Rigid motions of bones, joint coordinates, and blends of motions.

Open :mod:`~vtkmuscle.core.motion.rigid` for rigid transforms and tabulated motions, and
:mod:`~vtkmuscle.core.motion.blending` for blends of motions and screws.
"""
