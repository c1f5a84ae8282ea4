"""
Quick start: a spindle over a hinge
===================================

A muscle is filled with fibres and deformed with the bones; the fibres are carried along and measured.
"""

import pyvista as pv

from vtkmuscle.filters import BoneMotion, FibreMetrics, FibreTransport, FibreTubes
from vtkmuscle.phantoms import spindle_over_hinge
from vtkmuscle.pipelines import decompose, deform

phantom = spindle_over_hinge()
muscle, attachments = phantom.muscles["spindle"], phantom.attachments["spindle"]
fibres = decompose(muscle, attachments, n_fibres=50)  # a chain of five filters
deformer = deform(muscle, phantom.bones, phantom.motion, attachments, fibres=fibres)

carried = FibreTransport(rest_fibres=fibres, rest_muscle=muscle, deformed_muscle=deformer)
measured = carried >> FibreMetrics()
tubes = measured >> FibreTubes(radius=0.6)

for angle in (0.0, 20.0, 40.0):
    lengths = measured.apply(time=angle)["Length"]
    print(f"{angle:2.0f} degrees: fibres of {lengths.min():.1f} to {lengths.max():.1f} mm")

# %%
# Blue fibres are shorter than at rest, red fibres longer:

bones = BoneMotion(bones=phantom.bones, motion=phantom.motion)
plotter = pv.Plotter(shape=(1, 3), window_size=(1200, 600), border=False)
for column, angle in enumerate((0.0, 20.0, 40.0)):
    plotter.subplot(0, column)
    plotter.add_text(f"{angle:.0f} degrees", font_size=12)
    plotter.add_mesh(bones.apply(time=angle), color="ivory")
    plotter.add_mesh(deformer.apply(time=angle), color="darkred", opacity=0.35, smooth_shading=True)
    coloured = {"scalars": "Strain", "cmap": "coolwarm", "clim": (-0.2, 0.2), "show_scalar_bar": False}
    plotter.add_mesh(tubes.apply(time=angle), **coloured)
    plotter.view_vector((1.0, -0.6, 0.1), viewup=(0, 0, 1))
    plotter.camera.zoom(1.3)
plotter.show()
