"""
Bones as voxels, and points fixed to bones
==========================================

Figures 3 to 5 of Kohout and Cervenka 2021, on the phantom hip. The picture shows a bone cut into as many
voxels as in the paper (:class:`~vtkmuscle.filters.FixedPointDetector` with ``method="collision"``).
"""

import numpy as np
import pyvista as pv

from vtkmuscle import phantoms
from vtkmuscle.core.pbd.voxels import build_voxel_grid
from vtkmuscle.data.arrays import blocks_of, checked_surface
from vtkmuscle.filters import FixedPointDetector

hip = phantoms.hip()
plotter = pv.Plotter(shape=(1, 3), window_size=(1400, 560), border=False)
for column, settings in enumerate(({"n_equal": 64}, {"n_max": 64**3}, {"n_max": 8 * 64**3})):
    plotter.subplot(0, column)
    for _, block in blocks_of(hip.bones):
        grid = build_voxel_grid(*checked_surface(block, "bone"), **settings)
        image = pv.ImageData(
            dimensions=np.array(grid.cells.shape) + 1, spacing=grid.spacing, origin=grid.origin
        )
        image.cell_data["state"] = grid.cells.ravel(order="F")
        plotter.add_mesh(image.threshold(0.5, scalars="state"), color="#efe6d0", ambient=0.12)
    (words,) = (f"{name} = {value}" for name, value in settings.items())
    plotter.add_text(words, position=(10, 520), font_size=12)
    plotter.camera_position = [(450, -450, 130), (10, 40, 0), (0, 0, 1)]
plotter.show()

# %%
# Three rules fix points: inside a bone's voxels (collision), near a bone (proximity), or within landmarks
# (attachment). Collision and proximity also fix points that should slide along the bone: on the iliacus,
# between the origin and the pelvic brim.

iliacus, areas = hip.muscles["iliacus"], hip.attachments["iliacus"]
methods = ({"method": "collision"}, {"method": "proximity"}, {"method": "attachment"})
plotter = pv.Plotter(shape=(1, 3), window_size=(1400, 560), border=False)
for column, settings in enumerate(methods):
    plotter.subplot(0, column)
    muscle = FixedPointDetector(n_voxels=64**3, **settings).apply(iliacus, hip.bones, areas)
    fixed = np.array(muscle["FixedTo"]) >= 0
    print(f"{settings['method']}: {fixed.sum()} of {len(fixed)} points are fixed")
    plotter.add_mesh(muscle, color="#b06060", scalars=None, smooth_shading=True)
    plotter.add_points(muscle.points[fixed], color="#0072b2", point_size=6, render_points_as_spheres=True)
    plotter.add_text(settings["method"], position=(10, 520), font_size=12)
    plotter.camera_position = [(-350, 280, 50), (-10, 0, 10), (0, 0, 1)]
plotter.show()
