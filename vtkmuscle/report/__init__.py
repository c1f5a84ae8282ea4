"""The page of a run as an HTML file."""

from vtkmuscle.report.contents import MuscleContent, RunContent
from vtkmuscle.report.page import page_of, write_page

__all__ = ["MuscleContent", "RunContent", "page_of", "write_page"]
