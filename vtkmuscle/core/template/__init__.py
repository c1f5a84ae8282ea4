"""Fibre templates in a cube, and their fit to a muscle.

Kohout et al. 2012, sections 3.1 and 3.2. Open :mod:`~vtkmuscle.core.template.kinds` for the templates
(parallel, pennate, curved, fanned), and :mod:`~vtkmuscle.core.template.fitting` for the fit.
"""
