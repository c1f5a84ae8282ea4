"""Muscles for other programs: paths in models of OpenSim, tendons in models of MuJoCo.

What is written here is a :class:`~vtkmuscle.core.motion.tree.KinematicTree` with paths, so that a test can
ask the other program for the same lengths and moment arms.
"""

from vtkmuscle.export.enriching import enriched
from vtkmuscle.export.from_run import ExportedMuscle, export_muscles, write_mujoco, write_opensim
from vtkmuscle.export.mujoco import mjcf_of
from vtkmuscle.export.opensim import MuscleOut, osim_of

__all__ = [
    "ExportedMuscle",
    "MuscleOut",
    "enriched",
    "export_muscles",
    "mjcf_of",
    "osim_of",
    "write_mujoco",
    "write_opensim",
]
