"""From the template into the muscle, slice by slice: Kohout et al. 2012, section 3.3.

Open :mod:`~vtkmuscle.core.morphing.planes` for the paper's planes, :mod:`~vtkmuscle.core.morphing.isolines`
for isolines of a harmonic function (Kohout and Kukacka 2014), and
:mod:`~vtkmuscle.core.morphing.correspondence` for where contours start and for the map of one slice.
"""
