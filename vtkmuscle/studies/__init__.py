"""Vary a scene and run it: errors, sensitivity and cohorts are settings of one mechanism.

Open :mod:`~vtkmuscle.studies.variation` for what is changed in a scene, :mod:`~vtkmuscle.studies.case` for
one muscle of one varied scene and what is kept of it, :mod:`~vtkmuscle.studies.study` for how they are run,
resumed and kept, and :mod:`~vtkmuscle.report.sections` for the pages. No other part of the package imports
this one, but for the command line.
"""
