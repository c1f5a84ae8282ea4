"""Moment arms from lengths of fibres over a motion.

Open :mod:`~vtkmuscle.core.moment_arms.derivatives` for one coordinate,
:mod:`~vtkmuscle.core.moment_arms.of_joints` for a motion with several. The slopes are those of
:mod:`~vtkmuscle.core.moment_arms.local_regression`.
"""
