"""The page of a run: one HTML file with scene, curves and tables."""

from vtkmuscle.report.contents import MuscleContent, RunContent
from vtkmuscle.report.page import page_of, write_page

__all__ = ["MuscleContent", "RunContent", "page_of", "write_page"]
