"""Joints and OpenSim: models read and written, scenes with joints, muscles for other programs.

The rest of the package does not need it: a scene that has joints or names a model asks for it, and so does
the command. What is written is a :class:`~vtkmuscle.opensim.tree.KinematicTree` with paths, so that a test
can ask the other program for the same lengths and moment arms.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vtkmuscle.opensim.checking import ModelCheck, check_model
    from vtkmuscle.opensim.enriching import enriched
    from vtkmuscle.opensim.from_run import ExportedMuscle, errors_table, write_mujoco, write_opensim
    from vtkmuscle.opensim.mjcf import mjcf_of
    from vtkmuscle.opensim.model import OsimModel, read_osim
    from vtkmuscle.opensim.motion_file import MotionFile, read_motion_file
    from vtkmuscle.opensim.osim_text import MuscleOut, osim_of

#: Names of each module, which is loaded when one of them is asked for: a scene with joints exports nothing.
_NAMES = {
    "checking": ("ModelCheck", "check_model"),
    "enriching": ("enriched",),
    "from_run": ("ExportedMuscle", "errors_table", "write_mujoco", "write_opensim"),
    "mjcf": ("mjcf_of",),
    "model": ("OsimModel", "read_osim"),
    "motion_file": ("MotionFile", "read_motion_file"),
    "osim_text": ("MuscleOut", "osim_of"),
}
_SOURCES = {name: module for module, names in _NAMES.items() for name in names}

__all__ = [
    "ExportedMuscle",
    "ModelCheck",
    "MotionFile",
    "MuscleOut",
    "OsimModel",
    "check_model",
    "enriched",
    "errors_table",
    "mjcf_of",
    "osim_of",
    "read_motion_file",
    "read_osim",
    "write_mujoco",
    "write_opensim",
]


def __getattr__(name: str) -> Any:
    if name in _SOURCES:
        return getattr(import_module(f"{__name__}.{_SOURCES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
