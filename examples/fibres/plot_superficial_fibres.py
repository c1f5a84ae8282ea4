"""
Fibres seen on the surface
==========================

Nothing in the shape of this spindle tells that its fibres wind around it. Five fibres seen on the middle of
its surface (yellow) do: the sections of the muscle are turned against each other, along their contours,
until the template's fibres run like them.
"""

import pyvista as pv

from vtkmuscle.data.arrays import field_array
from vtkmuscle.filters import FibreTubes
from vtkmuscle.phantoms import winding_spindle
from vtkmuscle.pipelines import decompose

phantom = winding_spindle(twist=90.0)
muscle, attachments = phantom.muscles["spindle"], phantom.attachments["spindle"]
seen = phantom.superficial["spindle"]

plotter = pv.Plotter(shape=(1, 2), window_size=(800, 600), border=False)
for column, superficial in enumerate((None, seen)):
    fibres = decompose(muscle, attachments, superficial, n_fibres=120)
    tubes = fibres >> FibreTubes(radius=0.6)
    plotter.subplot(0, column)
    plotter.add_mesh(tubes.update().output, color="#b5524a", smooth_shading=True)
    plotter.add_mesh(pv.wrap(seen).tube(radius=0.9), color="#e6c229", smooth_shading=True)
    twist = field_array(fibres.update().output, "Twist")[0]
    plotter.add_text(f"twist: {twist:.0f} degrees", font_size=12)
    plotter.view_vector((1.0, 0.3, 0.25), viewup=(0, 0, 1))
plotter.show()
