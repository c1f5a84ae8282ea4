"""Triangle surfaces: edges, normals, volume; mending; distances; harmonic functions; polylines.

Open :mod:`~vtkmuscle.core.mesh.surface` for measures, neighbourhoods, and the four points of each dihedral
angle, :mod:`~vtkmuscle.core.mesh.closed_shells` for the repair of surfaces that are not closed,
:mod:`~vtkmuscle.core.mesh.solids` for what is inside of them, :mod:`~vtkmuscle.core.mesh.triangle_tree` for
the nearest point of a surface, and :mod:`~vtkmuscle.core.mesh.harmonic` for harmonic functions. Neither paper
describes these; they are textbook.
"""
