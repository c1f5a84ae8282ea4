"""VTK data: arrays, attachments, moving bones, provenance; and the package's own tables."""

import tomllib
from importlib.resources import files
from typing import Any


def package_text(package: str, name: str) -> str:
    """Return the text of a file of the package."""
    return (files(package) / name).read_text(encoding="utf-8")


def toml_table(package: str, name: str) -> dict[str, Any]:
    """Return the tables of a .toml file of the package."""
    return tomllib.loads(package_text(package, name))
