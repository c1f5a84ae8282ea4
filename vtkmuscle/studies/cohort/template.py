"""A scene with variables, filled in from a row of a table."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from vtkmuscle.core.words import suggestion
from vtkmuscle.scene.faults import SceneError

#: A variable: the name of a column, and what it is to be, if not text.
_VARIABLE = re.compile(r"\{([^{}:]+)(:number)?\}")
#: A value that is left out.
_NOTHING = object()


def filled(value: Any, row: Mapping[str, str], file: Path, key: str = "") -> Any:
    """Return a value of a template, or a table of values, with a subject's variables filled in.

    ``{COLUMN}`` stands for the text in that column; a text that is ``{COLUMN:number}`` is a number; one that
    is ``{COLUMN}`` alone, of an empty cell, is left out.

    Raises
    ------
    SceneError
        If there is no such column, or a number is none; names file and key.

    Examples
    --------
    >>> from pathlib import Path
    >>> from vtkmuscle.studies.cohort.template import filled
    >>> row = {"side": "left", "turn": "", "x": "1.5"}
    >>> filled({"a": "femur_{side}.stl", "b": "{turn}", "c": ["{x:number}", 0]}, row, Path("t.toml"))
    {'a': 'femur_left.stl', 'c': [1.5, 0]}
    """
    found = _filled(value, row, file, key)
    return {} if found is _NOTHING else found


def _filled(value: Any, row: Mapping[str, str], file: Path, key: str) -> Any:
    if isinstance(value, Mapping):
        named = {
            name: _filled(one, row, file, f"{key}.{name}".removeprefix(".")) for name, one in value.items()
        }
        return {name: one for name, one in named.items() if one is not _NOTHING}
    if isinstance(value, list):
        listed = [_filled(one, row, file, f"{key}[{number}]") for number, one in enumerate(value)]
        return [one for one in listed if one is not _NOTHING]
    if not isinstance(value, str):
        return value
    alone = _VARIABLE.fullmatch(value)
    if alone is None:
        return _VARIABLE.sub(lambda match: _cell(match, row, file, key), value)
    cell = _cell(alone, row, file, key)
    if not cell:
        return _NOTHING
    return _number(cell, alone[1], file, key) if alone[2] else cell


def _cell(match: re.Match[str], row: Mapping[str, str], file: Path, key: str) -> str:
    if match[1] not in row:
        problem = f"{match[0]} is no variable: the table of subjects has no column {match[1]!r}"
        raise SceneError(problem, key, suggestion(match[1], row), file)
    return row[match[1]]


def _number(cell: str, column: str, file: Path, key: str) -> float:
    try:
        number = float(cell)
        return int(number) if number == int(number) and "." not in cell else number
    except (ValueError, OverflowError):  # text, NaN, or infinity
        problem = f"column {column!r} of subjects has {cell[:60]!r}, but must be a finite number"
        raise SceneError(problem, key, "correct the table of subjects", file) from None


def laid_over(values: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return tables with others laid over them: keys of the latter count, tables are merged."""
    merged = dict(values)
    for name, one in changes.items():
        under = merged.get(name)
        merged[name] = laid_over(under, one) if isinstance(under, dict) and isinstance(one, dict) else one
    return merged
