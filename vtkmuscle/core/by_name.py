"""Objects with items by name, and remedies for attributes that are missing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from vtkmuscle.core.words import suggestion


class Remedies:
    """An object of which a missing attribute's error names the nearest attribute."""

    def __getattr__(self, name: str) -> Any:
        problem = f"{type(self).__name__!r} object has no attribute {name!r}"
        if name.startswith("_"):  # protocols of Python ask, and need no remedy
            raise AttributeError(problem)
        public = {word for word in (*dir(type(self)), *vars(self)) if not word.startswith("_")}
        raise AttributeError(f"{problem}; {suggestion(name, sorted(public))}")


class ByName(Remedies):
    """Items by name, as of a mapping.

    A subclass gives ``keys()`` and ``[name]``; iteration gives names.
    """

    def keys(self) -> list[str]:
        """Return the names of the items."""
        raise NotImplementedError

    def __getitem__(self, name: str) -> Any:
        raise NotImplementedError

    def values(self) -> list[Any]:
        """Return the items."""
        return [self[name] for name in self.keys()]

    def items(self) -> list[tuple[str, Any]]:
        """Return names and items."""
        return [(name, self[name]) for name in self.keys()]

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    def __len__(self) -> int:
        return len(self.keys())

    def __contains__(self, name: object) -> bool:
        return name in self.keys()
