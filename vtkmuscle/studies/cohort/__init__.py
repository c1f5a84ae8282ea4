"""Cohorts: many subjects, motions and muscles, run by Dask, into one table.

``vtkmuscle cohort STUDY.toml --out DIR`` on the command line; needs ``pip install '.[cohort]'``.
"""

from vtkmuscle.studies.cohort.run import run_study
from vtkmuscle.studies.cohort.subjects import Study
from vtkmuscle.studies.cohort.table import COLUMNS
from vtkmuscle.studies.study import Progress

__all__ = ["COLUMNS", "Progress", "Study", "run_study"]
