"""
The direction of fibres in a mesh
=================================

:class:`~vtkmuscle.filters.FibreField` adds fibre directions to any mesh or grid for finite elements, here to
a slice through a belly like a gastrocnemius. Strokes are coloured by the angle to the aponeuroses. For FEBio
see :doc:`/how_to/finite_elements`.
"""

import numpy as np
import pyvista as pv
from belly import pennate_belly

from vtkmuscle.filters import FibreField, FibreSource

phantom = pennate_belly()
muscle = phantom.muscles["belly"]
fibres = FibreSource(n_fibres=300)(muscle, phantom.attachments["belly"])

grid = pv.create_grid(pv.wrap(muscle), dimensions=(49, 2, 9))
field = FibreField().apply(grid, fibres, muscle)
print(f"{field['InMuscle'].sum()} of {field.n_cells} cells are in the muscle")

# %%
inside = field.threshold(0.5, scalars="InMuscle")
inside.cell_data["angle"] = np.degrees(np.arcsin(inside["FibreDirection"][:, 2]))
stroke = pv.Line((-1.4, 0.0, 0.0), (1.4, 0.0, 0.0))
strokes = inside.cell_centers().glyph(orient="FibreDirection", scale=False, geom=stroke)

plotter = pv.Plotter(window_size=(900, 300))
bar = {
    "title": "degrees",
    "vertical": True,
    "position_x": 0.9,
    "position_y": 0.2,
    "height": 0.6,
    "fmt": "%.0f",
}
plotter.add_mesh(strokes, scalars="angle", line_width=5, lighting=False, scalar_bar_args=bar)
plotter.add_mesh(muscle, color="darkred", opacity=0.12, smooth_shading=True)
plotter.view_xz()
plotter.camera.zoom(2.4)
plotter.show()
