"""The page of a run as an HTML file."""

from vtkmuscle.report.page import page_of, write_page
from vtkmuscle.report.scene3d import MuscleContent, RunContent

__all__ = ["MuscleContent", "RunContent", "page_of", "write_page"]
