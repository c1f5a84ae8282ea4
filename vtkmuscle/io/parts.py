"""Finished parts of a computation on disk, for later runs.

A part has a name and a key, a digest of all that it depends on (:mod:`vtkmuscle.run.store.keys`). A part of
another key, or a damaged one, is ignored.
"""

from __future__ import annotations

import hashlib
import json
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vtkmuscle.io.writing import replacing

#: Entry of a file that holds the key and the facts; no array has this name.
_FACTS = "facts"
#: The key in the facts that stands for an array.
_ARRAY = "array of this name"


@dataclass(frozen=True, eq=False)
class Part:
    """The content of a finished part: ``facts`` for JSON, and ``arrays``, which are kept bit by bit."""

    facts: Mapping[str, Any] = field(default_factory=dict)
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Self:
        """Return a part of values with arrays and dataclasses at any depth, which :attr:`values` gives back.

        Examples
        --------
        >>> import numpy as np
        >>> from vtkmuscle.io.parts import Part
        >>> Part.of({"motion": {"times": np.arange(2.0), "centre": None}}).values
        {'motion': {'times': array([0., 1.]), 'centre': None}}
        """
        arrays: dict[str, NDArray[Any]] = {}

        def plain_of(value: Any) -> Any:
            if isinstance(value, np.ndarray):
                arrays[f"array{len(arrays)}"] = value
                return {_ARRAY: f"array{len(arrays) - 1}"}
            if is_dataclass(value):
                value = {one.name: getattr(value, one.name) for one in fields(value)}
            if isinstance(value, Mapping):
                return {key: plain_of(one) for key, one in value.items()}
            return [plain_of(one) for one in value] if isinstance(value, list | tuple) else value

        return cls(plain_of(values), arrays)

    @property
    def values(self) -> Any:
        """The values given to :meth:`of`; dataclasses as mappings of their fields, tuples as lists."""

        def whole_of(value: Any) -> Any:
            if isinstance(value, dict):
                if value.keys() == {_ARRAY}:
                    return self.arrays[value[_ARRAY]]
                return {key: whole_of(one) for key, one in value.items()}
            return [whole_of(one) for one in value] if isinstance(value, list) else value

        return whole_of(self.facts)


class Parts:
    """A folder of finished parts, a file ``NAME.npz`` for each, which is moved into place complete.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import mkdtemp
    >>> from vtkmuscle.io.parts import Part, Parts
    >>> parts = Parts(Path(mkdtemp()))
    >>> parts.made("one", "key", lambda: Part({"value": 1})).facts
    {'value': 1}
    >>> parts.made("one", "key", lambda: Part({"value": 2})).facts  # it exists, and is not made again
    {'value': 1}
    >>> parts.read("one", "another key") is None
    True
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, name: str) -> Path:
        """Return the file of a part."""
        return self.folder / f"{name}.npz"

    def read(self, name: str, key: str | None = None) -> Part | None:
        """Return a part; None where there is none, it is damaged, or its key is another.

        Without a key, any key will do.
        """
        try:
            with self.path(name).open("rb") as file, np.load(file, allow_pickle=False) as kept:
                found = json.loads(str(kept[_FACTS]))
                if key is not None and found["key"] != key:
                    return None
                arrays = {entry: kept[entry] for entry in kept.files if entry != _FACTS}
                return Part(found["facts"], arrays)
        except (OSError, ValueError, TypeError, KeyError, EOFError, zipfile.BadZipFile, zlib.error):
            return None
        except (NotImplementedError, RecursionError, MemoryError, SyntaxError):  # of damaged headers
            return None

    def write(self, name: str, key: str, part: Part) -> None:
        """Write a part, in place of one of the same name."""
        text = json.dumps({"key": key, "facts": part.facts}, allow_nan=False, default=plain)
        with replacing(self.path(name)) as beside, beside.open("wb") as file:
            entries: dict[str, Any] = {_FACTS: np.array(text), **part.arrays}
            np.savez_compressed(file, allow_pickle=False, **entries)

    def made(self, name: str, key: str, make: Callable[[], Part]) -> Part:
        """Return the existing part, or a new one, which is written."""
        found = self.read(name, key)
        if found is None:
            self.write(name, key, make())
            found = self.read(name, key)
        if found is None:
            raise OSError(f"{self.path(name)}: it cannot be read again right after it was written")
        return found


def file_digest(path: Path) -> str:
    """Return the SHA-256 of a file's content."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def plain(value: Any) -> Any:
    """Return a value for JSON in place of one that JSON does not know."""
    if isinstance(value, Path):
        return str(value)
    if hasattr(value, "tolist"):
        return value.tolist()
    return repr(value)
