"""Moment arms: levers of paths in every pose, and slopes of lengths over a motion.

Open :mod:`~vtkmuscle.core.moment_arms.levers` for what a moment arm is, and
:mod:`~vtkmuscle.core.moment_arms.of_joints` for those of a motion.
"""
