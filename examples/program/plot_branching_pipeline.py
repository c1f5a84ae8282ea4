"""
Two muscles that share bones
============================

The pipelines of :doc:`/how_to/pipelines`: three lines, then a pipeline with branches.
"""

import pyvista as pv

from vtkmuscle.filters import BoneMotion, FibreMetrics, FixedPointDetector, PathDeformer, TautPaths
from vtkmuscle.phantoms import hip, spindle_over_hinge
from vtkmuscle.pipelines import decompose, deform
from vtkmuscle.plotting import choose_view, make_plotter

# %%
# Three lines:

phantom = spindle_over_hinge()
muscle, attachments = phantom.muscles["spindle"], phantom.attachments["spindle"]
bent = deform(muscle, phantom.bones, phantom.motion, attachments).apply(time=40.0)

# %%
plotter = pv.Plotter(window_size=(420, 600))
moving = BoneMotion(bones=phantom.bones, motion=phantom.motion)
plotter.add_mesh(moving.apply(time=40.0), color="ivory")
plotter.add_mesh(bent, color="darkred", smooth_shading=True)
plotter.view_vector((1.0, -0.6, 0.1), viewup=(0, 0, 1))
plotter.show()

# %%
# A BoneMotion moves the bones for both muscles; the fixed points of a muscle go to three filters:

phantom = hip()
bones = phantom.bones
moving = BoneMotion(bones=bones, motion=phantom.motion)
deformed, measured = {}, {}
for name in ("gluteus_medius", "iliacus"):
    attachments = phantom.attachments[name]
    fixed = FixedPointDetector(muscle=phantom.muscles[name], bones=bones, attachments=attachments)
    fibres = decompose(fixed, attachments, template=phantom.templates[name], n_fibres=40)
    posed = {"rest_bones": bones, "bones": moving}
    paths = TautPaths(rest_fibres=fibres, rest_muscle=fixed, attachments=attachments, **posed)
    deformed[name] = PathDeformer(muscle=fixed, paths=paths, fibres=fibres, **posed)
    measured[name] = FibreMetrics(fibres=deformed[name].GetOutputPort(1))

for name, chain in measured.items():
    lengths = [f"{chain.apply(time=angle)['Length'].mean():.1f}" for angle in (0.0, 30.0)]
    print(f"{name}: mean fibre length {' and '.join(lengths)} mm at 0 and 30 degrees")

# %%
bones, muscles = moving(time=30.0), [deformer.apply(time=30.0) for deformer in deformed.values()]
lines = pv.merge([chain.apply(time=30.0) for chain in measured.values()])
plotter = make_plotter(bones, muscles, choose_view(muscles, [bones] * 2), fibres=lines, off_screen=None)
plotter.view_vector((-1.0, -0.8, 0.2), viewup=(0, 0, 1))
plotter.camera.zoom(1.4)
plotter.show()
