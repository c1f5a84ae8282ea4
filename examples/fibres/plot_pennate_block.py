"""
A block with known fibres
=========================

The fibres of a pennate muscle run at an angle between two tendon sheets. The block has fibres of known angle
and length; the example recovers both from the surface and the attachment areas.
"""

import pyvista as pv

from vtkmuscle.filters import FibreMetrics
from vtkmuscle.phantoms import pennate_block
from vtkmuscle.pipelines import decompose

phantom = pennate_block()
((name, muscle),) = phantom.muscles.items()
fibres = decompose(muscle, phantom.attachments[name], template=phantom.templates[name], n_fibres=60)
measured = FibreMetrics().apply(fibres, muscle)

print(f"length:    known {phantom.known['fibre_length']:.2f} mm, measured {measured['Length'].mean():.2f} mm")
print(f"pennation: known {phantom.known['pennation']:.2f} degrees, ", end="")
print(f"measured {measured['PennationOrigin'].mean():.2f} degrees at the origin")

# %%
plotter = pv.Plotter()
plotter.add_mesh(muscle, color="darkred", opacity=0.3)
plotter.add_mesh(measured.tube(radius=0.4), color="mistyrose", smooth_shading=True)
plotter.show()
