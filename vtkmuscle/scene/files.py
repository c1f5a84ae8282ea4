"""The scene file and the files named in it."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from vtkmuscle.core.errors import MOST_TEXT, check_is_file, fault_of
from vtkmuscle.scene.faults import SceneError, errors_at

T = TypeVar("T")


def parsed(path: Path) -> dict[str, Any]:
    """Return the content of a scene.toml; SceneError if unreadable."""
    if path.is_dir():
        remedy = f"give its scene file, e.g. {path / 'scene.toml'}"
        raise SceneError("this is a folder, not a scene file", "", remedy, path)
    try:
        check_is_file(path, most=MOST_TEXT)
        return tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError as error:
        problem = "there is no such file" if not path.exists() else "is a pipe or a device, not a file"
        raise SceneError(problem, "", "check the path", path) from error
    except OSError as error:
        raise SceneError(f"cannot be read: {error.strerror}", "", "", path) from error
    except UnicodeDecodeError as error:
        raise SceneError("is not text in UTF-8", "", "save it as UTF-8", path) from error
    except tomllib.TOMLDecodeError as error:
        remedy = "correct that line; put texts in double quotes"
        raise SceneError(f"is not valid TOML: {error}", "", remedy, path) from error
    except (ValueError, RecursionError) as error:  # too large, an endless number, or too many brackets
        raise SceneError(f"cannot be read: {fault_of(error)[0]}", "", "correct it", path) from error


class SceneFiles:
    """Paths of a scene's files by dotted key.

    Texts in the scene are paths relative to the folder of the scene file.
    """

    def __init__(self, path: Path) -> None:
        self.paths = {"": path}

    def read(self, key: str, text: str, reader: Callable[[Path], T]) -> T:
        """Read the file of a key by a reader; SceneError if unreadable."""
        path = self.paths[""].parent / text
        self.paths[key] = path
        with errors_at(key, path, f"check {key.rpartition('.')[2]} = {text!r} and the file it names"):
            return reader(path)
