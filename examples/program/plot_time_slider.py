"""
A time slider
=============

Drag the slider, and the muscle follows: :func:`~vtkmuscle.plotting.show_time` requests the output of every
filter on the plotter at the slider's time, also between time steps and backwards. Frames already shown are
not computed again.
"""

import pyvista as pv
from vtkmodules.vtkFiltersGeometry import vtkCompositeDataGeometryFilter

from vtkmuscle.filters import BoneMotion
from vtkmuscle.phantoms import spindle_over_hinge
from vtkmuscle.pipelines import deform
from vtkmuscle.plotting import show_time

phantom = spindle_over_hinge()
muscle = deform(phantom.muscles["spindle"], phantom.bones, phantom.motion, phantom.attachments["spindle"])
bones = BoneMotion(bones=phantom.bones, motion=phantom.motion)
surface = vtkCompositeDataGeometryFilter()
surface.SetInputConnection(bones.GetOutputPort())

plotter = pv.Plotter(window_size=(700, 800))
plotter.add_mesh(muscle, color="darkred", smooth_shading=True)
plotter.add_mesh(surface, color="ivory", smooth_shading=True, split_sharp_edges=True)
plotter.view_vector((1.0, -0.6, 0.1), viewup=(0, 0, 1))
slider = plotter.add_slider_widget(
    lambda time: show_time(plotter, time),
    (phantom.motion.times[0], phantom.motion.times[-1]),
    title="degrees of flexion",
    value=30.0,
    pointa=(0.2, 0.1),
    pointb=(0.8, 0.1),
)
plotter.show()
