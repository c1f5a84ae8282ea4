"""Muscles stay out of bones: Kohout and Cervenka 2021, section 3.2, and signed distances.

Open :mod:`~vtkmuscle.core.collision.voxels` for the paper's voxels,
:mod:`~vtkmuscle.core.collision.distance_collision` for the response by signed distances (ours), and
:mod:`~vtkmuscle.core.collision.contact` for which points can meet which bone in a step.
"""
