"""The page of a run as an HTML file."""

from vtkmuscle.report.page import page_of

__all__ = ["page_of"]
