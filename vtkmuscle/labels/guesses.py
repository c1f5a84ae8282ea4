"""What was guessed of a scene, and how sure each guess is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: A less sure guess should be checked before the results are used.
LOOK = 0.5
#: The value of a guess about something that is not in the scene.
LEFT_OUT = "left out"


@dataclass(frozen=True)
class Guess:
    """A guess: the key of the scene, such as ``joints.hip_right.centre``, its value, and how sure it is.

    ``value`` is "" where there is none. ``sureness`` is from 0 to 1. ``why`` gives the reason, or what is
    needed for a value.
    """

    what: str
    value: str
    sureness: float
    why: str

    def __str__(self) -> str:
        mark = "  LOOK AT IT" if self.sureness < LOOK else ""
        return f"sureness {self.sureness:.2f}: {self.why}{mark}"


def table_of(guesses: Sequence[Guess]) -> list[list[str]]:
    """Return the rows of a table of guesses, the least sure first, with a header."""
    rows = sorted(guesses, key=lambda one: one.sureness)
    header = ["sureness", "what", "guess", "why"]
    return [header, *([f"{one.sureness:.2f}", one.what, one.value, one.why] for one in rows)]
