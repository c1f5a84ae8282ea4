"""What was guessed of a scene, and how sure each guess is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: A guess that is less sure wants to be looked at before anything is relied on.
LOOK = 0.5
#: The value of a guess about something that is not in the scene.
LEFT_OUT = "left out"


@dataclass(frozen=True)
class Guess:
    """Something that nobody has said.

    Attributes
    ----------
    what : str
        The key of the scene, such as ``joints.hip_right.centre``.
    value : str
        What it was taken to be; "" where it could not be.
    sureness : float
        From 0, as likely otherwise, to 1.
    why : str
        What speaks for it, or why there is none and what to give.
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
