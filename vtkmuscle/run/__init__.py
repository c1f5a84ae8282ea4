"""Running a scene: muscles measured, results written to a folder.

Every muscle is measured over the motion.
"""

from vtkmuscle.run.frames import RunOptions, frame_numbers
from vtkmuscle.run.muscles import muscle_pipeline
from vtkmuscle.run.result import Result
from vtkmuscle.run.steps import ONLY, run_only, run_scene
from vtkmuscle.run.table import MomentArmTable, Table

__all__ = [
    "ONLY",
    "MomentArmTable",
    "Result",
    "RunOptions",
    "Table",
    "frame_numbers",
    "muscle_pipeline",
    "run_only",
    "run_scene",
]
