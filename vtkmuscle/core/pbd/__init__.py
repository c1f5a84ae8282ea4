"""Position based dynamics of one muscle: Kohout and Cervenka 2021, section 2 and algorithm 2.

Open :mod:`~vtkmuscle.core.pbd.solver` for algorithm 2, :mod:`~vtkmuscle.core.pbd.constraints` for the
constraints of sections 2.1 to 2.3 (equations 2 to 7), :mod:`~vtkmuscle.core.pbd.orders` for the order of the
projections, :mod:`~vtkmuscle.core.pbd.anisotropy` for the stiffness along fibres (section 3.1, equation 9).
The acceleration of the iterations (:mod:`~vtkmuscle.core.pbd.anderson`) is not in the paper.
:mod:`~vtkmuscle.core.pbd.muscle_model` makes the solver of a muscle from its surface, bones and fibres.
"""
