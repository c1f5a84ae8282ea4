"""
Fibres seen on the surface
==========================

Nothing in the shape of this spindle tells that its fibres wind around it. Five fibres seen on the middle of
its surface (yellow) do: the sections of the muscle are turned against each other, along their contours,
until the template's fibres run like them.
"""

import numpy as np
import pyvista as pv

from vtkmuscle.data.arrays import field_array
from vtkmuscle.filters import FibreTubes
from vtkmuscle.phantoms import spindle_over_hinge
from vtkmuscle.pipelines import decompose

phantom = spindle_over_hinge()
muscle, attachments = phantom.muscles["spindle"], phantom.attachments["spindle"]

# Points of the five fibres, which wind by 90 degrees from end to end.
part = np.linspace(0.2, 0.8, 9)
radius = 7.0 + 9.0 * np.sin(np.pi * part) ** 2
angles = 0.4 * np.pi * np.arange(5)[:, None] + 0.5 * np.pi * part
points = [
    np.column_stack([radius * np.cos(angle), radius * np.sin(angle) - 32.0, 140.0 * part - 60.0])
    for angle in angles
]
seen = pv.merge([pv.MultipleLines(one) for one in points])

plotter = pv.Plotter(shape=(1, 2), window_size=(800, 600), border=False)
for column, superficial in enumerate((None, seen)):
    fibres = decompose(muscle, attachments, superficial, n_fibres=120)
    tubes = fibres >> FibreTubes(radius=0.6)
    plotter.subplot(0, column)
    plotter.add_mesh(tubes.update().output, color="#b5524a", smooth_shading=True)
    plotter.add_mesh(seen.tube(radius=0.9), color="#e6c229", smooth_shading=True)
    twist = field_array(fibres.update().output, "Twist")[0]
    plotter.add_text(f"twist: {twist:.0f} degrees", font_size=12)
    plotter.view_vector((1.0, 0.3, 0.25), viewup=(0, 0, 1))
plotter.show()
