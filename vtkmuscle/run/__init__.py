"""Running a scene: every muscle over the motion, measured, written to a folder."""

from vtkmuscle.run.result import Result
from vtkmuscle.run.scenes import frame_numbers, run_scene

__all__ = ["Result", "frame_numbers", "run_scene"]
