"""Algorithm 2 of Kohout and Cervenka 2021 as printed, doi:10.1007/978-3-030-72379-8_24.

Open :mod:`~vtkmuscle.core.algorithm_2.solver` for the algorithm, line by line,
:mod:`~vtkmuscle.core.algorithm_2.constraints` for equations 1 to 7 and 9, and
:mod:`~vtkmuscle.core.collision.voxels` for the bones. It is a solver of its own, and knows nothing of paths.
"""
