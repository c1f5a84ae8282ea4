"""Position based dynamics of a muscle's surface.

The method is Kohout and Cervenka 2021, as printed and made stable, doi:10.1007/978-3-030-72379-8_24. Open
:mod:`~vtkmuscle.core.pbd.solver` for Algorithm 2, line by line, and the changes for stability,
:mod:`~vtkmuscle.core.pbd.sweep` for equations 1 to 7 and 9, :mod:`~vtkmuscle.core.pbd.voxels` for section
3.2, and :mod:`~vtkmuscle.core.pbd.levels` for a fine surface that follows a coarse surface.
"""
