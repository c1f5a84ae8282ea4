"""
The papers' chain, filter by filter
===================================

Fixed points, position based dynamics, and the fibres of a template: fitted, morphed, trimmed, smoothed,
transported and drawn as tubes. Each stage is a VTK algorithm; only a request to the last stage runs the
chain.
"""

import pyvista as pv

from vtkmuscle import filters, phantoms

hip = phantoms.hip()
muscle, areas = hip.muscles["gluteus_maximus"], hip.attachments["gluteus_maximus"]

# %%
# The muscle: points fixed to the bones, bones in motion, position based dynamics.

fixed = filters.FixedPointDetector(muscle=muscle, bones=hip.bones, attachments=areas)
moving = filters.BoneMotion(bones=hip.bones, motion=hip.motion)
deformed = filters.PBDDeformer(muscle=fixed, rest_bones=hip.bones, bones=moving)

# %%
# The fibres: a template in the unit cube, fitted to the muscle, morphed isoline by isoline, trimmed to the
# areas and smoothed; then moved with the muscle, measured, and drawn as tubes.

template = filters.FibreTemplateSource(template="parallel", n_fibres=60)
fitted = filters.TemplateFitter(template=template, muscle=muscle, attachments=areas)
morphed = filters.SliceMorpher(template=fitted, muscle=muscle, attachments=areas, method="harmonic")
trimmed = filters.FibreTrimmer(fibres=morphed, muscle=muscle, attachments=areas)
rest = filters.FibreSmoother(fibres=trimmed)
moved = filters.FibreTransport(rest_fibres=rest, rest_muscle=fixed, deformed_muscle=deformed)
tubes = filters.FibreTubes(fibres=filters.FibreMetrics(fibres=moved), radius=0.9)

# %%
# The pipeline at three times: VTK computes the stages needed for each picture.

plotter = pv.Plotter(shape=(1, 3), window_size=(1500, 620), border=False)
for column, angle in enumerate((0.0, 30.0, 60.0)):
    plotter.subplot(0, column)
    for bone in moving.apply(time=angle):
        plotter.add_mesh(bone, color="ivory", smooth_shading=True, split_sharp_edges=True)
    plotter.add_mesh(deformed.apply(time=angle), color="firebrick", opacity=0.25, smooth_shading=True)
    bar = {"title": "fibre strain", "fmt": "%.1f"} if column == 1 else None
    colours = {"scalars": "Strain", "cmap": "coolwarm", "clim": (-0.6, 0.6)}
    fibres = tubes.apply(time=angle)
    plotter.add_mesh(fibres, smooth_shading=True, show_scalar_bar=column == 1, scalar_bar_args=bar, **colours)
    plotter.add_text(f"{angle:.0f} degrees", font_size=12)
    plotter.view_vector((-1.0, 0.6, 0.1), viewup=(0, 0, 1))
    plotter.reset_camera(bounds=deformed.apply(time=0.0).bounds)
    plotter.camera.zoom(1.0)
plotter.show()
