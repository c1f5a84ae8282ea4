"""
The fibres of 2012, filter by filter
====================================

Kohout, Clapworthy, Martelli, Viceconti 2012: a template of fibres in the unit cube is fitted to the muscle,
mapped into the muscle section by section, cut at the attachment areas and smoothed. Each stage is a VTK
filter with the settings of the paper (:data:`vtkmuscle.pipelines.PUBLISHED_FIBRES`).
"""

import pyvista as pv

from vtkmuscle import filters, phantoms

hip = phantoms.hip()
where = {"muscle": hip.muscles["gluteus_maximus"], "attachments": hip.attachments["gluteus_maximus"]}

template = filters.FibreTemplateSource(template="parallel", n_fibres=64)
fitted = filters.TemplateFitter(template=template, axis="attachments", angle_step=5.0, **where)
morphed = filters.SliceMorpher(template=fitted, method="plane", continuity=0.0, **where)
trimmed = filters.FibreTrimmer(fibres=morphed, end_rule="closest", **where)
smoothed = filters.FibreSmoother(fibres=trimmed, smoothing_weight=4.0, spreading=0.0)
measured = smoothed >> filters.FibreMetrics()

lengths = measured.apply()["Length"]
print(f"{len(lengths)} fibres of {lengths.min():.0f} to {lengths.max():.0f} mm")

# %%
# A fibre keeps its colour, its place across the template: in the cube, fitted to the muscle's box, mapped
# into the muscle, and smoothed between the areas.

across = template.apply().points.reshape(64, -1, 3)[:, 0, :2] @ (1.0, 0.3)
plotter = pv.Plotter(shape=(1, 4), window_size=(1600, 520), border=False)
stages = {"template": template, "fitted": fitted, "mapped": morphed, "trimmed and smoothed": measured}
for column, (name, stage) in enumerate(stages.items()):
    plotter.subplot(0, column)
    fibres = stage.apply()
    fibres["place"] = across
    thick = filters.FibreTubes(radius=0.006 * fibres.length).apply(fibres)
    plotter.add_mesh(thick, scalars="place", cmap="viridis", smooth_shading=True, show_scalar_bar=False)
    if column:
        plotter.add_mesh(pv.wrap(where["muscle"]), color="indianred", opacity=0.2, smooth_shading=True)
        for bone in pv.wrap(hip.bones):
            plotter.add_mesh(bone, color="ivory", smooth_shading=True)
    plotter.add_text(name, position=(10, 480), font_size=12)
    plotter.view_vector((-1.0, 0.6, 0.1) if column else (1.0, -0.8, 0.4), viewup=(0, 0, 1))
    plotter.reset_camera(bounds=(fitted if column else template).apply().bounds)
    plotter.camera.zoom(1.45 if column else 1.0)
plotter.show()
