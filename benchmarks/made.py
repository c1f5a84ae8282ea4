"""What generated tables of the documentation were made with: ``made.json`` beside them.

For each table it has the command that made it, a hash of the settings (defaults of all filters, presets,
fibres as published), one of the scripts, and one of the table itself. A table whose hashes are not today's is
stale: the page shows what today's defaults would not give. ``remake.py`` makes them again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from vtkmuscle import filters
from vtkmuscle.filters.deformer import PRESETS
from vtkmuscle.pipelines import PUBLISHED_FIBRES

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent / "docs"
PAPER, HOW_RIGHT = DOCS / "validation/paper_tables", DOCS / "validation/how_right_tables"
#: Scripts of tables beside those of ``how_right.py``.
SCRIPTS = {"battery": "battery.py", **dict.fromkeys(("stated", "stated_cover"), "stated_errors.py")}
#: Filters that no table is made with.
WITHOUT_TABLES = {"AttachmentEstimator", "LabelSurfaces"}


def settings() -> str:
    """Return the hash of what a user gets without asking, and of what is called published."""
    defaults = {
        name: {key: repr(one.default) for key, one in getattr(filters, name).parameter_declarations.items()}
        for name in sorted({*filters.__all__} - WITHOUT_TABLES)
        if hasattr(getattr(filters, name), "parameter_declarations")
    }
    named: tuple[Mapping[str, Mapping[str, Any]], ...] = (PRESETS, PUBLISHED_FIBRES)
    groups = [{name: repr(sorted(values.items())) for name, values in group.items()} for group in named]
    return _hash(json.dumps([defaults, groups], sort_keys=True).encode())


def sources(scripts: Iterable[Path]) -> str:
    """Return the hash of some scripts."""
    return _hash(b"".join(path.read_bytes() for path in sorted(scripts)))


def scripts_of(table: Path) -> list[Path]:
    """Return the scripts that make a table."""
    if table.parent == PAPER:
        paper = HERE / "paper"
        return [paper / f"{table.stem}.py", paper / "common.py", paper / "published_loop.py"]
    return [HERE / SCRIPTS.get(table.stem, "how_right.py")]


def tables() -> list[Path]:
    """Return the generated tables of the documentation."""
    return sorted([*PAPER.glob("*.txt"), *HOW_RIGHT.rglob("*.csv")])


def of(table: Path) -> dict[str, str]:
    """Return what a table was made with; empty where nothing says so."""
    noted = _noted(table)
    return dict(noted.get(table.name, {}))


def note(table: Path, command: str) -> None:
    """Note that a table was made just now."""
    entry = {"command": command, "settings": settings(), "sources": sources(scripts_of(table))}
    noted = _noted(table) | {table.name: entry | {"table": _hash(table.read_bytes())}}
    text = json.dumps(dict(sorted(noted.items())), indent=1)
    (table.parent / "made.json").write_text(text + "\n", encoding="utf-8")


def why_stale(table: Path) -> str:
    """Return why a table is not what today's defaults give; "" where it is."""
    made = of(table)
    if not made:
        return "nothing says what it was made with"
    if made["table"] != _hash(table.read_bytes()):
        return "it was changed by hand"
    if made["settings"] != settings():
        return "defaults have changed"
    return "" if made["sources"] == sources(scripts_of(table)) else "its script has changed"


def _noted(table: Path) -> dict[str, dict[str, str]]:
    path = table.parent / "made.json"
    noted: dict[str, dict[str, str]] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    return noted


def _hash(content: bytes) -> str:
    return hashlib.sha256(content.replace(b"\r\n", b"\n")).hexdigest()[:12]
