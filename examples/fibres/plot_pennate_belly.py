"""
Oblique fibres, coloured
========================

A belly like a gastrocnemius: fibres run obliquely between equal shares of two aponeuroses. Colours show the
pennation, the length, and the origin on the proximal aponeurosis: neighbours stay neighbours. Lengths and
angles of the phantom are exact by formula.
"""

import numpy as np
import pyvista as pv
from belly import pennate_belly
from matplotlib.colors import hsv_to_rgb

from vtkmuscle.filters import FibreMetrics, FibreSource

phantom = pennate_belly()
muscle, attachments = phantom.muscles["belly"], phantom.attachments["belly"]
fibres = FibreSource(n_fibres=300)(muscle, attachments)
measured = FibreMetrics().apply(fibres, muscle)
x, y, _ = measured.points.reshape(measured.n_cells, -1, 3)[:, 0].T

for name, answer in (("Length", "fibre_length"), ("PennationOrigin", "pennation")):
    known = np.array([phantom.known[answer](place) for place in x])
    print(f"{name}: known {known.min():.1f} to {known.max():.1f}", end=", ")
    print(f"half of the fibres are within {np.median(np.abs(measured[name] - known)):.2f}")

# %%
# In the third picture, hue is the direction from the centre of the aponeurosis, saturation the distance:

away = np.hypot(x / np.abs(x).max(), y / np.abs(y).max())
hue = np.arctan2(y / np.abs(y).max(), x / np.abs(x).max()) / (2 * np.pi) % 1.0
measured.cell_data["Place"] = hsv_to_rgb(np.column_stack([hue, np.minimum(away, 1.0), np.full(len(x), 0.9)]))

bar = {"vertical": True, "position_x": 0.9, "position_y": 0.2, "height": 0.6, "fmt": "%.0f"}
looks = {
    "pennation": {
        "scalars": "PennationOrigin",
        "cmap": "viridis",
        "scalar_bar_args": {"title": "degrees", **bar},
    },
    "length": {"scalars": "Length", "cmap": "plasma", "scalar_bar_args": {"title": "mm", **bar}},
    "place on the proximal aponeurosis": {"scalars": "Place", "rgb": True},
}
plotter = pv.Plotter(shape=(3, 1), window_size=(900, 960), border=False)
for row, (title, look) in enumerate(looks.items()):
    plotter.subplot(row, 0)
    plotter.add_mesh(measured.tube(radius=0.7), smooth_shading=True, ambient=0.3, **look)
    plotter.add_mesh(muscle, color="darkred", opacity=0.12, smooth_shading=True)
    plotter.add_text(title, position=(10, 270), font_size=10)
    plotter.view_vector((0.2, -0.8, 0.9), viewup=(0, 0, 1))
    plotter.camera.zoom(2.1)
plotter.show()
