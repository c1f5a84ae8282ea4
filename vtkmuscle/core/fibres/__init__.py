"""Fibres in a muscle: their ends, their spread, and how they follow the surface.

Open :mod:`~vtkmuscle.core.fibres.trimming` for the ends on the attachment areas (Kohout et al. 2012, section
3.4), :mod:`~vtkmuscle.core.fibres.mean_value` for the mean value coordinates that carry fibres (Kohout and
Cervenka 2021, equation 8), and :mod:`~vtkmuscle.core.fibres.measures` for lengths and smoothing.
"""
