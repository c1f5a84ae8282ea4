"""Bones as exact surfaces and signed distances.

The distances are fields, filled at the first look-up of a region. Open :mod:`~vtkmuscle.core.bones.bone` for
the queries of a bone, and :mod:`~vtkmuscle.core.bones.lookup` for the kernels' look-ups of distances.
"""
