"""Readers and writers of the field's formats: surfaces, landmarks, motion tables, time series.

Every reader raises a ``FileNotFoundError`` or a ``ValueError`` that names the file and the remedy, and
keeps VTK's own messages off the terminal.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vtkmuscle.io.febio import febio_axes
    from vtkmuscle.io.fibre_table import fibre_summary, muscle_summary, write_fibre_table
    from vtkmuscle.io.landmarks import read_aponeurosis, read_landmarks, read_named_points
    from vtkmuscle.io.literature import (
        LITERATURE_COLUMNS,
        LiteratureCurve,
        curves_for,
        read_literature,
        write_literature,
    )
    from vtkmuscle.io.motion_table import motion_columns, read_motion_table, write_motion_table
    from vtkmuscle.io.msf import TREE_SUFFIXES, MsfNode, landmarks_of, read_msf, surfaces_of
    from vtkmuscle.io.series import Collection, Series
    from vtkmuscle.io.surfaces import SURFACE_SUFFIXES, read_polydata, read_surface
    from vtkmuscle.io.temporal import SERIES_SUFFIXES, TimeSeries, read_series, write_vtkhdf
    from vtkmuscle.io.writing import write_polydata, write_text

#: Names of each module, which is loaded when one of them is asked for: few need all formats.
_NAMES = {
    "febio": ("febio_axes",),
    "fibre_table": ("fibre_summary", "muscle_summary", "write_fibre_table"),
    "landmarks": ("read_aponeurosis", "read_landmarks", "read_named_points"),
    "literature": (
        *("LITERATURE_COLUMNS", "LiteratureCurve", "curves_for"),
        *("read_literature", "write_literature"),
    ),
    "motion_table": ("motion_columns", "read_motion_table", "write_motion_table"),
    "msf": ("TREE_SUFFIXES", "MsfNode", "landmarks_of", "read_msf", "surfaces_of"),
    "series": ("Collection", "Series"),
    "surfaces": ("SURFACE_SUFFIXES", "read_polydata", "read_surface"),
    "temporal": ("SERIES_SUFFIXES", "TimeSeries", "read_series", "write_vtkhdf"),
    "writing": ("write_polydata", "write_text"),
}
_SOURCES = {name: module for module, names in _NAMES.items() for name in names}

__all__ = [
    "LITERATURE_COLUMNS",
    "SERIES_SUFFIXES",
    "SURFACE_SUFFIXES",
    "TREE_SUFFIXES",
    "Collection",
    "LiteratureCurve",
    "MsfNode",
    "Series",
    "TimeSeries",
    "curves_for",
    "febio_axes",
    "fibre_summary",
    "landmarks_of",
    "motion_columns",
    "muscle_summary",
    "read_aponeurosis",
    "read_landmarks",
    "read_literature",
    "read_motion_table",
    "read_msf",
    "read_named_points",
    "read_polydata",
    "read_series",
    "read_surface",
    "surfaces_of",
    "write_fibre_table",
    "write_literature",
    "write_motion_table",
    "write_polydata",
    "write_text",
    "write_vtkhdf",
]


def __getattr__(name: str) -> Any:
    if name in _SOURCES:
        return getattr(import_module(f"{__name__}.{_SOURCES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
