"""
Five templates of fibres
========================

:class:`~vtkmuscle.filters.FibreTemplateSource` makes five kinds of fibres in the unit cube, from the origin
area (blue) to the insertion area (red), as in figure 4 of Kohout et al. 2012. Later stages fit the cube to a
muscle and morph the fibres.
"""

import pyvista as pv

from vtkmuscle.filters import FibreTemplateSource, FibreTubes

KINDS = ("parallel", "pennate", "bipennate", "curved", "fan")

plotter = pv.Plotter(shape=(1, 5), window_size=(1500, 380), border=False)
plotter.enable_anti_aliasing("ssaa")
for column, kind in enumerate(KINDS):
    source = FibreTemplateSource(template=kind, n_fibres=60, resolution=15)
    tubes = source >> FibreTubes(radius=0.008)
    fibres = pv.wrap(source.update().output)
    plotter.subplot(0, column)
    plotter.add_text(kind, font_size=14)
    plotter.add_mesh(pv.Cube(bounds=(0, 1, 0, 1, 0, 1)), style="wireframe", color="grey")
    plotter.add_mesh(tubes.update().output, color="#e8b49c", smooth_shading=True)
    for t, colour in ((0.0, "blue"), (1.0, "red")):
        ends = fibres.points[fibres["t"] == t]
        plotter.add_points(ends, color=colour, point_size=7, render_points_as_spheres=True)
    plotter.view_vector((0.5, -1.0, 0.25), viewup=(0, 0, 1))
    plotter.camera.zoom(1.1)
plotter.show()
