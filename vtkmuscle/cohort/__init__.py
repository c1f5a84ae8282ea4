"""Cohorts: many subjects, motions and muscles, run by Dask, into one table.

``vtkmuscle cohort STUDY.toml --out DIR`` on the command line; needs ``pip install 'vtkmuscle[cohort]'``.
"""

from vtkmuscle.cohort.running import Progress, run_study
from vtkmuscle.cohort.statistics import compared, spreads
from vtkmuscle.cohort.study import Study
from vtkmuscle.cohort.tables import COLUMNS

__all__ = ["COLUMNS", "Progress", "Study", "compared", "run_study", "spreads"]
