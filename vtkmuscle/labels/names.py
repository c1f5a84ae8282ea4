"""Kinds of structures by name, and tables of labels."""

from __future__ import annotations

import re
from functools import cache
from importlib.resources import files
from pathlib import Path

from vtkmuscle.core.errors import InputError
from vtkmuscle.core.words import quoted, suggestion
from vtkmuscle.data.anatomy import ANATOMY, plain_name
from vtkmuscle.data.label_images import MOST
from vtkmuscle.io.csv_table import csv_rows

_BONES, _NEITHER = (
    re.compile(rf"(?:^|_)(?:{'|'.join(ANATOMY[words])})(?:_|$)") for words in ("bone_words", "other_words")
)
_MUSCLES = re.compile(rf"(?:^|_)(?:{'|'.join(ANATOMY['muscle_starts'])})")


def kind_of(name: str) -> str | None:
    """Return ``"bone"``, ``"muscle"``, or None for other names."""
    plain = plain_name(name)
    if _NEITHER.search(plain):
        return None
    if _MUSCLES.search(plain):
        return "muscle"
    return "bone" if _BONES.search(plain) else None


@cache
def _tables() -> dict[str, dict[int, str]]:
    tables: dict[str, dict[int, str]] = {}
    for line in files("vtkmuscle.labels").joinpath("names.csv").read_text(encoding="utf-8").splitlines()[3:]:
        table, label, name = line.split(",")
        tables.setdefault(table, {})[int(label)] = name
    return tables


def label_number(text: str, path: Path, where: str) -> int:
    """Return the whole number in a text, from 0 to the largest label."""
    if not re.fullmatch(r"\s*[0-9]{1,9}\s*", text, re.ASCII) or int(text) > MOST:
        problem = f"{where} is {quoted(text.strip())}, but must be a whole number from 0 to {MOST}"
        raise InputError(path, problem, "correct it")
    return int(text)


def name_table(source: str) -> dict[int, str]:
    """Return names by label from a built-in or .csv table with lines of label, name.

    A missing table or file, or a line without label and name, raises a FileNotFoundError or ValueError.
    """
    if source in _tables():
        return _tables()[source]
    path = Path(source)
    if path.suffix.lower() != ".csv":
        raise InputError(source, "unknown table of names", suggestion(source, [*_tables(), "FILE.csv"]))
    names: dict[int, str] = {}
    for number, cells in csv_rows(path):
        if len(cells) > 1 and (cells[0].isdecimal() or names):
            names[label_number(cells[0], path, f"line {number}: the label")] = cells[1]
        elif names:
            raise InputError(path, f"line {number} is not a label and a name", "write 5, femur_left")
    if not names:
        raise InputError(path, "the file has no line of a label and a name", "write 5, femur_left")
    return names
