"""Triangle surfaces and polylines.

Open :mod:`~vtkmuscle.core.mesh.surface` for measures and neighbourhoods, :mod:`~vtkmuscle.core.mesh.solids`
for the repair of open surfaces and the inside of closed ones, and
:mod:`~vtkmuscle.core.mesh.triangle_tree` for nearest points.
"""
