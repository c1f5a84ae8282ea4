"""What was found out last, kept for the case that it is asked for again."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any


class Recent:
    """Keeps what was found out for the last few keys, and forgets what has not been asked for longest.

    Parameters
    ----------
    most : int
        How many things are kept, >= 1.

    Examples
    --------
    >>> from vtkmuscle.core.recent import Recent
    >>> recent = Recent(2)
    >>> recent("a", lambda: 1), recent("a", lambda: 2)
    (1, 1)
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._found: dict[Hashable, Any] = {}

    def __call__(self, key: Hashable, find: Callable[[], Any]) -> Any:
        """Return what is kept for a key, or else what a function finds, which is kept from now on."""
        try:
            found = self._found.pop(key)
        except KeyError:
            found = find()
        self._found[key] = found
        for oldest in list(self._found)[: -self._most]:
            self._found.pop(oldest, None)
        return found
