"""Values and suggestions in messages: of one line, and not longer than a reader's patience."""

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
    """Return a value as Python writes it, shortened where it is long or deep.

    Examples
    --------
    >>> from vtkmuscle.core.words import quoted
    >>> quoted([[[[1]]]]), quoted(10**100)
    ('[[[...]]]', '100000000000000000...0000000000000000000')
    """
    try:
        return _SHORT.repr(value)
    except ValueError:  # an integer of so many digits that Python does not write it
        return f"a number of more than {4300} digits"


def names(given: str | Iterable[str]) -> list[str]:
    """Return names as a list; a text is one name, not its letters.

    Examples
    --------
    >>> from vtkmuscle.core.words import names
    >>> names("iliacus"), names(("iliacus", "psoas"))
    (['iliacus'], ['iliacus', 'psoas'])
    """
    return [given] if isinstance(given, str) else list(given)


def suggestion(word: str, known: Iterable[str]) -> str:
    """Return the remedy for an unknown word: the nearest known one, and the list of all.

    Examples
    --------
    >>> from vtkmuscle.core.words import suggestion
    >>> suggestion("iteration", ["iterations", "tolerance"])
    "did you mean 'iterations'? allowed: iterations, tolerance"
    """
    known = list(known)
    near = get_close_matches(word, known, n=1, cutoff=0.5)
    meant = f"did you mean {near[0]!r}? " if near else ""
    return f"{meant}allowed: {', '.join(known) or 'none'}"
