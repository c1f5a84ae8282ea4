"""A table of frames' figures, printed row by row as they are done."""

from __future__ import annotations

import threading
from collections.abc import Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

#: Heading, key of :func:`~vtkmuscle.filters.deformer.shape_report.shape_row`, format, width.
_COLUMNS = (
    ("V/V0", "volume_ratio", ".4f", 7),
    ("l/l0 p95", "edge_stretch_p95", ".2f", 8),
    ("max", "edge_stretch_max", ".2f", 6),
    ("along", "along_fibres_p50", ".2f", 5),
    ("across p5", "across_fibres_p5", ".2f", 9),
    ("p95", "across_fibres_p95", ".2f", 5),
    ("angle p95", "dihedral_error_p95_deg", ".1f", 9),
    ("degen.", "degenerate_edges", "d", 6),
    ("hits", "colliding_points", "d", 6),
    ("depth", "penetration_max_mm", ".2f", 5),
    ("ms", "ms", ".1f", 7),
)

_GAP = "  "


class FrameTable:
    """Prints a row per frame, under one heading; from several threads, too.

    Lengths are in millimetres, angles in degrees; what is not known is left blank.

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
            What the row is of.
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
