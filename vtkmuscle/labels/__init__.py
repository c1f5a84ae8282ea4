"""Scenes from what there is: label maps, or meshes and landmarks, by guesses that say how sure they are.

``vtkmuscle from-labels`` and ``vtkmuscle init`` on the command line.

Examples
--------
>>> from vtkmuscle.labels import Guess
>>> print(Guess("units", "mm", 0.9, "the longest of all surfaces is 445"))
sureness 0.90: the longest of all surfaces is 445
"""

from vtkmuscle.labels.draft import Draft
from vtkmuscle.labels.guesses import Guess
from vtkmuscle.labels.maps import draft_of_labels
from vtkmuscle.labels.meshes import draft_of_files
from vtkmuscle.labels.reading import read_labels

__all__ = ["Draft", "Guess", "draft_of_files", "draft_of_labels", "read_labels"]
