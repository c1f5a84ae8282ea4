"""Values, names and suggestions in messages. Each in a short line."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable
from difflib import get_close_matches

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 80
_SHORT.maxlong = 40
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = 8
_SHORT.maxlevel = 3
#: Most words that a suggestion lists: a few lines of a terminal.
_MOST = 20


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
    more = f" and {len(allowed) - _MOST} more" if len(allowed) > _MOST else ""
    return f"{meant}allowed: {', '.join(allowed[:_MOST]) or 'none'}{more}"
