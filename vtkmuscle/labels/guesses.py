"""Guesses in a drafted scene, each with a confidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

#: Confidence below which a guess should be checked before the results are used.
LOOK = 0.5
#: Value of a guess about a structure that is missing in the scene.
LEFT_OUT = "left out"


@dataclass(frozen=True)
class Guess:
    """A guess for a key of a scene.

    Attributes
    ----------
    what : str
        The key, such as ``joints.hip_right.centre``.
    value : str
        The value, or "".
    confidence : float
        From 0 to 1.
    why : str
        The reason, or the missing information.
    """

    what: str
    value: str
    confidence: float
    why: str

    def __str__(self) -> str:
        mark = "  CHECK THIS" if self.confidence < LOOK else ""
        return f"confidence {self.confidence:.2f}: {self.why}{mark}"


def table_of(guesses: Sequence[Guess]) -> list[list[str]]:
    """Return a table of guesses by ascending confidence."""
    rows = sorted(guesses, key=lambda guess: guess.confidence)
    cells = [[f"{guess.confidence:.2f}", guess.what, guess.value, guess.why] for guess in rows]
    return [["confidence", "what", "guess", "why"], *cells]
