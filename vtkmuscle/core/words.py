"""Values, names and suggestions in messages, each in a short line; objects with items by name."""

import reprlib
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from importlib.resources import files
from os import PathLike
from typing import Any, Self

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 80
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = 8
_SHORT.maxlevel = 3
#: Most names that a message lists, and rows of a table in a cell: a few lines of a terminal.
MOST_LISTED = 20


def quoted(value: object) -> str:
    """Return a value as Python writes it, shortened."""
    try:
        return _SHORT.repr(value)
    except ValueError:  # Python writes no longer integers
        return "a number of more than 4300 digits"


def names(text: str | Iterable[str]) -> list[str]:
    """Return names as a list. A text is a single name."""
    return [text] if isinstance(text, str) else list(text)


def suggestion(word: str, allowed: Iterable[str]) -> str:
    """Return the remedy for an unknown word. The nearest and all allowed words."""
    allowed = list(allowed)
    nearest = get_close_matches(word, allowed, n=1, cutoff=0.5) or [each for each in allowed if word in each]
    meant = f"did you mean {nearest[0]!r}? " if nearest else ""
    return f"{meant}allowed: {listed(allowed)}"


def remedy_for(owner: str, name: str, allowed: Iterable[str]) -> str:
    """Return the remedy for a missing attribute."""
    elsewhere = tomllib.loads((files("vtkmuscle.core") / "words.toml").read_text(encoding="utf-8"))
    written = {**elsewhere["any"], **elsewhere.get(owner, {})}
    return f"write {written[name]}" if name in written else suggestion(name, allowed)


def listed(words: Sequence[str]) -> str:
    """Return words in a line, and the number of those beyond :data:`MOST_LISTED`."""
    more = [f"and {len(words) - MOST_LISTED} more"] * (len(words) > MOST_LISTED)
    return ", ".join([*words[:MOST_LISTED], *more]) or "none"


class Remedies:
    """An object of which a missing attribute's error names the nearest attribute."""

    def __getattr__(self, name: str) -> Any:
        problem = f"{type(self).__name__!r} object has no attribute {name!r}"
        if name.startswith("_"):  # protocols of Python ask, and need no remedy
            raise AttributeError(problem)
        public = {word for word in (*dir(type(self)), *vars(self)) if not word.startswith("_")}
        raise AttributeError(f"{problem}; {remedy_for(type(self).__name__, name, sorted(public))}")


class ByName(Remedies):
    """Items by name, as of a mapping.

    A subclass gives ``keys()`` and ``[name]``, and ``load(path)`` reads an object; iteration gives names.
    """

    def __new__(cls, *parts: Any, **named: Any) -> Self:
        """Return a new object; TypeError for a path alone."""
        if len(parts) == 1 and isinstance(parts[0], str | PathLike) and not named:
            raise TypeError(f"{cls.__name__} takes no path; write {cls.__name__}.load({str(parts[0])!r})")
        return super().__new__(cls)

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
