"""Vary a scene and run it: errors, sensitivity and cohorts are settings of one mechanism.

Open :mod:`~vtkmuscle.studies.variation` for the changes of a scene, :mod:`~vtkmuscle.studies.case` for one
muscle of one varied scene and its outcome, :mod:`~vtkmuscle.studies.study` for how cases are run, resumed and
kept, and :mod:`~vtkmuscle.report.sections` for the pages. Only the command line imports this package.
"""
