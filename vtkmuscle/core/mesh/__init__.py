"""Triangle surfaces and polylines.

Open :mod:`~vtkmuscle.core.mesh.surface` for measures and neighbourhoods, :mod:`~vtkmuscle.core.mesh.solids`
for closing surfaces and their inside, and :mod:`~vtkmuscle.core.mesh.triangle_tree` for nearest points.
"""
