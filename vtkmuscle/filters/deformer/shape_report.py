"""Shape report of a frame: field arrays, rows of figures, a table."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from vtkmuscle.core.mesh.rest_shape import ShapeReport
from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import field_array

#: Lengths among the field arrays, and their keys in a row of figures [mm].
LENGTHS = {
    "PenetrationMax": "penetration_max_mm",
    "PenetrationP95": "penetration_p95_mm",
}

#: The other field arrays of the report, and their keys.
FIGURES = {
    "VolumeRatio": "volume_ratio",
    "EdgeStretchP95": "edge_stretch_p95",
    "EdgeStretchMax": "edge_stretch_max",
    "DihedralErrorP95": "dihedral_error_p95_deg",
    "DegenerateEdges": "degenerate_edges",
    "CollidingPoints": "colliding_points",
    "PenetratingPoints": "penetrating_points",
}


def shape_fields(shape: ShapeReport) -> dict[str, float]:
    """Return the field arrays of a shape report."""
    return {
        "VolumeRatio": shape.volume_ratio,
        "EdgeStretchP95": shape.edge_stretch_p95,
        "EdgeStretchMax": shape.edge_stretch_max,
        "DihedralErrorP95": shape.dihedral_error_p95,
        "DegenerateEdges": shape.degenerate_edges,
    }


def penetration_fields(depths: Floats) -> dict[str, float]:
    """Return the field arrays of penetration depths (f,)."""
    return {
        "PenetrationMax": float(depths.max(initial=0.0)),
        "PenetrationP95": float(np.percentile(depths, 95)) if len(depths) else 0.0,
        "PenetratingPoints": int((depths > 0.0).sum()),
    }


def shape_row(fields: dict[str, float], millimetres: float = 1.0) -> dict[str, float]:
    """Return a frame's figures by key, lengths in millimetres.

    Parameters
    ----------
    fields : dict of str to float
        Field arrays, as from :func:`shape_fields`.
    millimetres : float, optional
        Millimetres per unit of length.
    """
    row = {key: fields[name] for name, key in FIGURES.items() if name in fields}
    row.update({key: fields[name] * millimetres for name, key in LENGTHS.items() if name in fields})
    return row


def read_shape(deformed: Any, millimetres: float = 1.0) -> dict[str, float]:
    """Return the figures of a deformed muscle by key; see :func:`shape_row`."""
    arrays = {name: field_array(deformed, name) for name in (*FIGURES, *LENGTHS)}
    fields = {name: array[-1].item() for name, array in arrays.items() if array is not None}
    return shape_row(fields, millimetres)


if TYPE_CHECKING:
    from rich.console import Console

#: Heading, key of :func:`~vtkmuscle.filters.deformer.shape_report.shape_row`, format, width.
_COLUMNS = (
    ("V/V0", "volume_ratio", ".4f", 7),
    ("l/l0 p95", "edge_stretch_p95", ".2f", 8),
    ("max", "edge_stretch_max", ".2f", 6),
    ("angle p95", "dihedral_error_p95_deg", ".1f", 9),
    ("degen.", "degenerate_edges", "d", 6),
    ("hits", "colliding_points", "d", 6),
    ("depth", "penetration_max_mm", ".2f", 5),
    ("ms", "ms", ".1f", 7),
)

_GAP = "  "


class FrameTable:
    """Print a row per frame under a heading, thread-safe.

    Lengths are in millimetres, angles in degrees; missing figures are blank.

    Parameters
    ----------
    console : rich.console.Console, optional
        Where to print to; standard error by default.
    label_width : int, optional
        Width of the first column.
    """

    def __init__(self, console: Console | None = None, *, label_width: int = 8) -> None:
        if console is None:
            from rich.console import Console as NewConsole  # noqa: PLC0415 -- only where a table is wanted

            console = NewConsole(stderr=True)
        self._console = console
        self._width = label_width
        self._lock = threading.Lock()
        self._begun = False

    def add(self, label: str, row: Mapping[str, float | None]) -> None:
        """Print the figures of a frame.

        Parameters
        ----------
        label : str
            Name of the row.
        row : mapping of str to float
            See :func:`~vtkmuscle.filters.deformer.shape_report.shape_row`.
        """
        cells = [f"{label:<{self._width}}"]
        for _, key, form, width in _COLUMNS:
            value = row.get(key)
            cells.append((" " if value is None else format(value, form)).rjust(width))
        with self._lock:
            if not self._begun:
                heading = [" " * self._width, *(name.rjust(width) for name, _, _, width in _COLUMNS)]
                self._print(_GAP.join(heading), "bold")
                self._begun = True
            self._print(_GAP.join(cells))

    def _print(self, line: str, style: str | None = None) -> None:
        self._console.print(line, style=style, markup=False, highlight=False, soft_wrap=True)
