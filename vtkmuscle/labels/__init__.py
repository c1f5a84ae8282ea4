"""Scenes drafted from label maps, or from meshes and landmarks.

Missing information is guessed; each guess has a confidence. The commands are ``vtkmuscle from-labels`` and
``vtkmuscle init``.

Examples
--------
>>> from vtkmuscle.labels import Guess
>>> print(Guess("units", "mm", 0.9, "the longest side of all surfaces is 445"))
confidence 0.90: the longest side of all surfaces is 445
"""

from vtkmuscle.labels.draft import Draft
from vtkmuscle.labels.guesses import Guess
from vtkmuscle.labels.page import draft_of_labels, from_labels, init
from vtkmuscle.labels.reading import read_labels

__all__ = ["Draft", "Guess", "draft_of_labels", "from_labels", "init", "read_labels"]
