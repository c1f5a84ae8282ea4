"""Values in messages: of one line, and not longer than a reader's patience."""

from __future__ import annotations

import reprlib

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 80
_SHORT.maxlong = 40
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = 8
_SHORT.maxlevel = 3


def shown(value: object) -> str:
    """Return a value as Python writes it, shortened where it is long or deep.

    Examples
    --------
    >>> from vtkmuscle.core.words import shown
    >>> shown([[[[1]]]]), shown(10**100)
    ('[[[...]]]', '100000000000000000...0000000000000000000')
    """
    try:
        return _SHORT.repr(value)
    except ValueError:  # an integer of so many digits that Python does not write it
        return f"a number of more than {4300} digits"
