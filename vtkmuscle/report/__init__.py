"""The page of a run: one file with the scene to be turned, curves, tables and what to make of them."""

from vtkmuscle.report.contents import MuscleContent, RunContent
from vtkmuscle.report.page import page_of, write_page

__all__ = ["MuscleContent", "RunContent", "page_of", "write_page"]
