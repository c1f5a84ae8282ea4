"""
Two muscles that share bones
============================

The pipelines of the guide "Write a pipeline": from three lines to one that branches.
"""

import pyvista as pv

from vtkmuscle.filters import BoneMotion, FibreMetrics, FibreTransport, FixedPointDetector, PBDDeformer
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
plotter.add_mesh(BoneMotion(motion=phantom.motion).apply(phantom.bones, time=40.0), color="ivory")
plotter.add_mesh(bent, color="darkred", smooth_shading=True)
plotter.view_vector((1.0, -0.6, 0.1), viewup=(0, 0, 1))
plotter.show()

# %%
# One BoneMotion moves the bones for two muscles; each muscle's fixed points go to two filters:

phantom = hip()
moving = BoneMotion(motion=phantom.motion)
moving.connect(0, phantom.bones)
deformed, measured = {}, {}
for name in ("gluteus_medius", "iliacus"):
    fixed = FixedPointDetector()
    for port, data in enumerate((phantom.muscles[name], phantom.bones, phantom.attachments[name])):
        fixed.connect(port, data)
    fibres = decompose(fixed, phantom.attachments[name], template=phantom.templates[name], n_fibres=40)
    deformed[name] = PBDDeformer()
    for port, upstream in enumerate((fixed, moving, fibres)):
        deformed[name].connect(port, upstream)
    transport = FibreTransport()
    for port, upstream in enumerate((fibres, fixed, deformed[name])):
        transport.connect(port, upstream)
    measured[name] = (transport >> FibreMetrics()).last

for name, metrics in measured.items():
    lengths = [f"{metrics.apply(time=angle)['Length'].mean():.1f}" for angle in (0.0, 30.0)]
    print(f"{name}: mean fibre length {' and '.join(lengths)} mm at 0 and 30 degrees")

# %%
bones, muscles = moving.update(time=30.0).output, [d.apply(time=30.0) for d in deformed.values()]
lines = pv.merge([metrics.apply(time=30.0) for metrics in measured.values()])
plotter = make_plotter(bones, muscles, choose_view(muscles, [bones] * 2), fibres=lines, off_screen=None)
plotter.view_vector((-1.0, -0.8, 0.2), viewup=(0, 0, 1))
plotter.camera.zoom(1.4)
plotter.show()
