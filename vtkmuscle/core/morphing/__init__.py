"""Fibres from the fitted template into a muscle, section by section.

Kohout et al. 2012, section 3.3. Open :mod:`~vtkmuscle.core.morphing.slices` for parallel planes, and
:mod:`~vtkmuscle.core.morphing.isolines` for isolines of a harmonic function (Kohout and Kukacka 2014).
"""
