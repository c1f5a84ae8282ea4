"""
A flexing hip as a GIF
======================

``plotter.add_mesh`` takes filters, and :func:`~vtkmuscle.plotting.show_time` sets the time of all filters on
a plotter. The phantom hip flexes, with fibres coloured by strain, and each picture becomes a frame of
``hip.gif``.
"""

import numpy as np
import pyvista as pv
from PIL import Image
from vtkmodules.vtkFiltersGeometry import vtkCompositeDataGeometryFilter

from vtkmuscle.filters import BoneMotion, FibreTubes
from vtkmuscle.phantoms import hip
from vtkmuscle.pipelines import MusclePipeline
from vtkmuscle.plotting import show_time

phantom = hip()
plotter = pv.Plotter(window_size=(480, 560), off_screen=True)
plotter.enable_anti_aliasing("ssaa")

for name, muscle in phantom.muscles.items():
    fibres = {"template": phantom.templates[name], "n_fibres": 40}
    attachments = phantom.attachments[name]
    pipeline = MusclePipeline(muscle, phantom.bones, phantom.motion, attachments, fixing={}, fibres=fibres)
    tubes = FibreTubes(fibres=pipeline.metrics, radius=0.8)
    plotter.add_mesh(pipeline.deformer, color="darkred", opacity=0.3, culling="back")
    coloured = {"scalars": "Strain", "cmap": "coolwarm", "clim": (-0.3, 0.3), "show_scalar_bar": False}
    plotter.add_mesh(tubes, **coloured)

bones = BoneMotion(bones=phantom.bones, motion=phantom.motion)
surface = vtkCompositeDataGeometryFilter()  # PyVista shows algorithms with a single mesh
surface.SetInputConnection(bones.GetOutputPort())
plotter.add_mesh(surface, color="ivory", smooth_shading=True)
plotter.view_vector((-0.6, 1.0, 0.2), viewup=(0, 0, 1))
plotter.camera.zoom(1.3)

pictures = []
for angle in np.linspace(0.0, 60.0, 13):
    show_time(plotter, angle)
    pictures.append(Image.fromarray(plotter.screenshot(return_img=True)))
pictures += pictures[-2:0:-1]  # and back
pictures[0].save("hip.gif", save_all=True, append_images=pictures[1:], duration=100, loop=0)
print(f"hip.gif: {len(pictures)} frames")
plotter.show()
