"""Cells of notebooks: tables and pictures in HTML."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from html import escape
from io import BytesIO
from itertools import islice
from typing import Any

#: Most rows of a table in a cell, as pandas shows 60: a cell's height on a screen.
MOST_ROWS = 20


def html_table(columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Return a table in HTML, of :data:`MOST_ROWS` rows at most."""
    listed = [tuple(columns), *islice(rows, MOST_ROWS)]
    texts = [[f"{value:.6g}" if isinstance(value, float) else str(value) for value in row] for row in listed]
    tags = ["th"] + ["td"] * (len(texts) - 1)
    lines = (
        "".join(f"<{tag}>{escape(text)}</{tag}>" for text in row)
        for tag, row in zip(tags, texts, strict=True)
    )
    return f"<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def html_picture(plotter: Callable[[], Any]) -> str:
    """Return the picture of a plotter in HTML, empty where none can be rendered."""
    from PIL import Image  # noqa: PLC0415 -- only pictures need it

    from vtkmuscle.plotting.drawing import can_render  # noqa: PLC0415 -- only pictures need it

    if can_render() is not None:
        return ""
    shown = plotter()
    file = BytesIO()
    Image.fromarray(shown.screenshot(return_img=True)).save(file, "PNG")
    shown.close()
    return f'<img width="480" src="data:image/png;base64,{b64encode(file.getvalue()).decode()}"/>'
