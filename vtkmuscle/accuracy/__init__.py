"""The error of every number of a run: what is known of it from the run, and what further solves tell.

Open :mod:`~vtkmuscle.accuracy.estimates` for the causes, how each one's part is had, and lengths, moment
arms, volumes and areas with their errors, and :mod:`~vtkmuscle.accuracy.stated` for what a run calls. Further
solves are a study, :mod:`vtkmuscle.studies.errors`.
"""

from vtkmuscle.accuracy.estimates import KINDS, SOLVED
from vtkmuscle.accuracy.stated import Solution, StatedErrors

__all__ = ["KINDS", "SOLVED", "Solution", "StatedErrors"]
