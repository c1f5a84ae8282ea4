"""Running a scene: every muscle over the motion, measured, written to a folder."""

from vtkmuscle.run.moment_arms import MomentArmTable
from vtkmuscle.run.result import Result
from vtkmuscle.run.scenes import frame_numbers, run_scene

__all__ = ["MomentArmTable", "Result", "frame_numbers", "run_scene"]
