"""
Fibres seen on the surface
==========================

The shape of the block leaves open to which side the fibres arch. Three fibres seen on the front (yellow)
decide: the template's box turns about the block's axis until the template's fibres run alike.
"""

import numpy as np
import pyvista as pv

from vtkmuscle.filters import FibreTubes
from vtkmuscle.phantoms import fibre_block
from vtkmuscle.pipelines import decompose

phantom = fibre_block("parallel")
muscle, attachments = phantom.muscles["block"], phantom.attachments["block"]
t = np.linspace(0.1, 0.9, 13)
arch = np.column_stack([8.0 - 24.0 * t * (1.0 - t), 0.0 * t, 120.0 * t])
seen = pv.merge([pv.lines_from_points(np.add(arch, [x, 0, 0])) for x in (0, 5, 10)]).strip(join=True)

plotter = pv.Plotter(shape=(1, 2), window_size=(800, 600), border=False)
for column, superficial in enumerate((None, seen)):
    fibres = decompose(muscle, attachments, superficial, template="curved", n_fibres=120)
    tubes = fibres >> FibreTubes(radius=0.6)
    plotter.subplot(0, column)
    plotter.add_mesh(tubes.update().output, color="#b5524a", smooth_shading=True)
    plotter.add_mesh(seen.tube(radius=0.9), color="#e6c229", smooth_shading=True)
    plotter.add_text("with the fibres seen" if superficial else "without", font_size=12)
    plotter.view_vector((0.2, -1.0, 0.1), viewup=(0, 0, 1))
plotter.show()
