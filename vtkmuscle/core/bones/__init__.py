"""Bones: exact surfaces, and signed distances as fields that are filled where they are asked for.

Open :mod:`~vtkmuscle.core.bones.bone` for what is asked of a bone, and :mod:`~vtkmuscle.core.bones.lookup`
for how kernels look distances up.
"""
