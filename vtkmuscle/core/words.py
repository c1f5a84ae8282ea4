"""Values, names and suggestions in messages, each in one short line."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable
from difflib import get_close_matches

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 80
_SHORT.maxlong = 40
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = 8
_SHORT.maxlevel = 3


def quoted(value: object) -> str:
    """Return a value as Python writes it, shortened where it is long or deep."""
    try:
        return _SHORT.repr(value)
    except ValueError:  # Python writes no longer integers
        return "a number of more than 4300 digits"


def names(given: str | Iterable[str]) -> list[str]:
    """Return names as a list; a text is one name, not its letters."""
    return [given] if isinstance(given, str) else list(given)


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return the remedy for an unknown word: the nearest known one, and the list of all."""
    known = list(known)
    near = get_close_matches(word, known, n=1, cutoff=0.5)
    meant = f"did you mean {near[0]!r}? " if near else ""
    return f"{meant}allowed: {', '.join(known) or 'none'}"
