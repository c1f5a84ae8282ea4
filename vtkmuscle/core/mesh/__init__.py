"""Triangle surfaces and polylines.

Open :mod:`~vtkmuscle.core.mesh.surface` for measures and neighbourhoods,
:mod:`~vtkmuscle.core.mesh.closed_shells` for the repair of open surfaces, :mod:`~vtkmuscle.core.mesh.solids`
for their inside, and :mod:`~vtkmuscle.core.mesh.triangle_tree` for nearest points.
"""
