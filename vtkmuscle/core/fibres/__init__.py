"""Fibres: ends, spread, and motion with the muscle's surface.

Open :mod:`~vtkmuscle.core.fibres.trimming` for ends on attachment areas (Kohout et al. 2012, section 3.4),
:mod:`~vtkmuscle.core.fibres.mean_value` for mean value coordinates (Kohout and Cervenka 2021, equation 8),
and :mod:`~vtkmuscle.core.fibres.measures` for lengths and smoothing.
"""
