"""
A block with known fibres
=========================

In a pennate muscle fibres run at an angle from one tendon sheet to the other. In this block both that
angle and the length of the fibres are known; here the two are recovered from its surface and its
attachment areas.
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
