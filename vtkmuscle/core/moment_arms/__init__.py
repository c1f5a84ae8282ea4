"""Moment arms: levers of paths per pose, and slopes of lengths.

Open :mod:`~vtkmuscle.core.moment_arms.levers` for the definition of a moment arm, and
:mod:`~vtkmuscle.core.moment_arms.of_joints` for the moment arms of a motion.
"""
