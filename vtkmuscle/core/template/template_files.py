"""A user's own fibre template, from a small TOML or JSON file.

A file names the sheets of control points from the origin area to the insertion area, each by its corners at
(r, s) = (0, 0), (1, 0), (1, 1) and (0, 1) in the unit cube (see :mod:`vtkmuscle.core.template.kinds`)::

    # A strap that bulges to the side: degree 2, three sheets.
    sheets = [
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],              # the origin area
        [[0.3, 0, 0.5], [1, 0, 0.5], [1, 1, 0.5], [0.3, 1, 0.5]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],              # the insertion area
    ]

A template of several parts, which share the range of r equally, has a list of tables instead: ``[[parts]]``,
each with ``sheets``; all of the same degree. In JSON the same names are keys of an object.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from vtkmuscle.core.errors import MOST_TEXT, InputError, check_is_file, fault_of
from vtkmuscle.core.template.kinds import FibreTemplate
from vtkmuscle.core.types import Floats
from vtkmuscle.core.words import quoted

#: Degrees of the Bezier curves.
DEGREES = (2, 3, 4)
CORNERS = 4


def read_template(path: str | Path) -> FibreTemplate:
    """Return the template in a file.

    Parameters
    ----------
    path : str or Path
        A ``.toml`` or ``.json`` file.

    Returns
    -------
    FibreTemplate
        With the sheets of the file.

    Raises
    ------
    ValueError
        If the file cannot be read, is not TOML or JSON, or does not hold a template; the message names the
        place in the file and what is allowed there.
    """
    file = Path(path)
    if file.suffix not in (".toml", ".json"):
        raise InputError("", f"the template {file} must be a .toml or a .json file")
    try:
        check_is_file(file, most=MOST_TEXT)
        text = file.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        problem, remedy = fault_of(error)
        raise InputError("", f"the template {file} cannot be read: {problem}", remedy) from error
    try:
        content = tomllib.loads(text) if file.suffix == ".toml" else json.loads(text)
    except (ValueError, RecursionError) as error:  # no TOML or JSON, an endless number, too many brackets
        kind = file.suffix[1:].upper()
        raise InputError("", f"the template {file} is not {kind}: {fault_of(error)[0]}") from error
    return template_from(content, file)


def template_from(content: Any, where: str | Path) -> FibreTemplate:
    """Return the template in the content of a file.

    Parameters
    ----------
    content : mapping
        With either ``sheets`` or ``parts``, a list of mappings with ``sheets``.
    where : str or Path
        Named in errors.

    Returns
    -------
    FibreTemplate
        The template.

    Raises
    ------
    ValueError
        If it is not one.
    """
    if not isinstance(content, Mapping) or set(content) not in ({"sheets"}, {"parts"}):
        keys = ", ".join(map(repr, content)) if isinstance(content, Mapping) else "no table"
        found = keys or "no key"
        raise InputError(where, f"{found}, but must be either the key 'sheets' or the key 'parts'")
    if "sheets" in content:
        return FibreTemplate((_sheets(content["sheets"], where, "sheets"),))
    tables = content["parts"]
    if not isinstance(tables, list) or not tables:
        raise InputError(where, "parts must be a list of at least one table with the key 'sheets'")
    parts = []
    for number, table in enumerate(tables):
        if not isinstance(table, Mapping) or set(table) != {"sheets"}:
            raise InputError(where, f"parts[{number}] must be a table with the key 'sheets', and no other")
        parts.append(_sheets(table["sheets"], where, f"parts[{number}].sheets"))
        if len(parts[-1]) != len(parts[0]):
            raise InputError(
                where,
                f"parts[{number}] has {len(parts[-1])} sheets and parts[0] {len(parts[0])}",
                "all parts must have the same number",
            )
    return FibreTemplate(tuple(parts))


def _sheets(value: Any, where: str | Path, key: str) -> Floats:
    """Return sheets of control points, (degree + 1, 4, 3)."""
    least, most = DEGREES[0] + 1, DEGREES[-1] + 1
    if not isinstance(value, list) or not least <= len(value) <= most:
        found = f"{len(value)} sheets" if isinstance(value, list) else quoted(value)
        raise InputError(
            where,
            f"{key}: {found}, but must be a list of {least} to {most} sheets, for Bezier curves of degree "
            f"{DEGREES[0]} to {DEGREES[-1]}",
        )
    for i, sheet in enumerate(value):
        if not isinstance(sheet, list) or len(sheet) != CORNERS:
            problem = f"{key}[{i}] must be a list of 4 corners, at (r, s) = (0, 0), (1, 0), (1, 1), (0, 1)"
            raise InputError(where, problem)
        for j, corner in enumerate(sheet):
            numbers = corner if isinstance(corner, list) else []
            good = [isinstance(x, int | float) and not isinstance(x, bool) and 0 <= x <= 1 for x in numbers]
            if len(good) != 3 or not all(good):
                raise InputError(
                    where,
                    f"{key}[{i}][{j}] is {quoted(corner)}, but must be three numbers from 0 to 1, a point "
                    "of the unit cube",
                )
    sheets = np.array(value, dtype=np.float64)
    for i, name in ((0, "origin"), (-1, "insertion")):
        first, second = sheets[i, 2] - sheets[i, 0], sheets[i, 3] - sheets[i, 1]
        if not np.linalg.norm(np.cross(first, second)) > 0.0:
            problem = f"{key}[{i % len(sheets)}] is the {name} area, but its corners enclose none"
            raise InputError(where, problem)
    if np.array_equal(sheets[0], sheets[-1]):
        raise InputError(where, f"{key}: the origin area and the insertion area are the same")
    return sheets
