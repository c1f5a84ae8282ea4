"""
The model in three pictures
===========================

A strap over a cylinder that turns by 60 degrees. Fibres become paths, pulled taut round the bones as a sheet;
the paths carry the surface; the surface settles: the volume is restored and the surface leaves the bone,
while the paths stay (:doc:`/explanation/model`).
"""

import numpy as np
import pyvista as pv

from vtkmuscle.core.mesh.surface import mean_thickness, signed_volume
from vtkmuscle.core.paths.lines import bones_at_ends
from vtkmuscle.core.skinning.skinning import Skinning
from vtkmuscle.filters import BoneMotion, FixedPointDetector, PathDeformer, TautPaths
from vtkmuscle.phantoms import wrapping_cylinder
from vtkmuscle.pipelines import decompose

phantom = wrapping_cylinder(angles=np.arange(0.0, 61.0, 6.0))
((name, muscle),) = phantom.muscles.items()
areas = phantom.attachments[name]
fixed = FixedPointDetector()(muscle, phantom.bones, areas)
bones = BoneMotion(bones=phantom.bones, motion=phantom.motion)
fibres = decompose(fixed, areas, n_fibres=60)
posed = {"rest_bones": phantom.bones, "bones": bones}
taut = TautPaths(rest_fibres=fibres, rest_muscle=fixed, **posed)
settled = PathDeformer(muscle=fixed, paths=taut, **posed).apply(time=60.0)
paths = taut.apply(time=60.0)

points, triangles, fixed_to = pv.wrap(fixed).points, settled.regular_faces, settled["FixedTo"].astype(int)
at_rest, now = (each.reshape(paths.n_cells, -1, 3) for each in (paths["RestPosition"], paths.points))
ends = bones_at_ends(at_rest, points, fixed_to)
transforms = np.array([bone.field_data["Transform"].reshape(4, 4) for bone in bones.apply(time=60.0)])
skinning = Skinning(at_rest, ends, points, fixed_to, mean_thickness(points, triangles))
carried = settled.copy()
carried.points = skinning.at(now, transforms).surface

rest = signed_volume(points, triangles)
for what, surface in (("taken along", carried), ("settled", settled)):
    print(f"{what}: volume {100.0 * (signed_volume(surface.points, triangles) / rest - 1.0):+.2g} %")

# %%
# The paths, the carried surface coloured by the displacement in settling, and the settled surface.

moved = np.linalg.norm(settled.points - carried.points, axis=1)
plotter = pv.Plotter(shape=(1, 3), window_size=(1200, 480), border=False)
for column in range(3):
    plotter.subplot(0, column)
    for bone in bones.apply(time=60.0):
        plotter.add_mesh(bone, color="ivory", smooth_shading=True, split_sharp_edges=True)
    if column == 1:
        bar = {"title": "settles by [mm]", "fmt": "%.1f", "n_labels": 3, "title_font_size": 18}
        plotter.add_mesh(carried, scalars=moved, cmap="viridis", smooth_shading=True, scalar_bar_args=bar)
    else:
        mesh, colour = (settled, "indianred") if column else (paths.tube(radius=0.5), "darkred")
        plotter.add_mesh(mesh, color=colour, smooth_shading=True)
    plotter.view_vector((1.0, 0.25, 0.35), viewup=(0, 0, 1))
    plotter.reset_camera(bounds=settled.bounds)
plotter.show()
