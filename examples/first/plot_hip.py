"""
A muscle of the phantom hip
===========================

The hip of :func:`vtkmuscle.phantoms.hip` flexes by 60 degrees. A run of the scene detects fixed points, makes
fibres, deforms the muscle and measures.
"""

import numpy as np

from vtkmuscle import RigidMotion, Scene, phantoms
from vtkmuscle.plotting import choose_view, make_plotter, strain_colours

phantom = phantoms.hip()
whole = Scene.from_phantom(phantom, n_fibres=60)
coarse = RigidMotion(
    np.arange(0.0, 61.0, 5.0), {"femur": [phantom.motion.at(a)["femur"] for a in range(0, 61, 5)]}
)
scene = Scene("hip", whole.bones, {"gluteus_medius": whole.muscles["gluteus_medius"]}, coarse)
result = scene.run()

lengths = result.fibre_lengths["gluteus_medius"]
for i in (0, 6, 12):
    print(f"{result.times[i]:2.0f} degrees: mean fibre length {lengths[i].mean():.1f} mm")

# %%
# The muscle in the last frame, with fibres coloured by strain:

muscle, bones = result.muscle("gluteus_medius", time=60.0), result.bones(time=60.0)
plotter = make_plotter(
    bones,
    [muscle],
    choose_view([muscle], [bones]),
    fibres=result.fibres("gluteus_medius", time=60.0),
    colours=strain_colours(100.0 * (lengths[-1] / lengths[0] - 1.0), limit=40.0),
    off_screen=None,
)
plotter.show()
