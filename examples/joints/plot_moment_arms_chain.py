"""
Moment arms, filter by filter
=============================

Fibres from area to area become taut paths around the moving bones; a filter measures the lever of each
path's pull about the joint. Each stage is a VTK filter, and a request at an angle computes what is needed.
"""

import matplotlib.pyplot as plt
import numpy as np
import pyvista as pv

from vtkmuscle import filters, phantoms

hip = phantoms.hip(angles=range(0, 91, 5))
name = "gluteus_medius"
areas = hip.attachments[name]

fixed = filters.FixedPointDetector(muscle=hip.muscles[name], bones=hip.bones, attachments=areas)
fibres = filters.FibreSource(muscle=fixed, attachments=areas, n_fibres=60)
moving = filters.BoneMotion(bones=hip.bones, motion=hip.motion)
bones = {"rest_bones": hip.bones, "bones": moving}
paths = filters.TautPaths(rest_fibres=fibres, rest_muscle=fixed, attachments=areas, **bones)
arms = filters.MomentArms(fibres=paths, motion=hip.motion)

# %%
# Paths in the colour of their moment arm: red paths extend the hip, blue paths flex it.

plotter = pv.Plotter(shape=(1, 3), window_size=(1500, 620), border=False)
for column, angle in enumerate((0.0, 45.0, 90.0)):
    plotter.subplot(0, column)
    tubes = filters.FibreTubes(radius=1.0).apply(arms.apply(time=angle))
    bar = {"title": "moment arm [mm]", "fmt": "%.0f", "position_x": 0.35, "position_y": 0.06}
    colours = {"scalars": "MomentArm", "cmap": "coolwarm_r", "clim": (-25, 25)}
    plotter.add_mesh(tubes, smooth_shading=True, show_scalar_bar=column == 2, scalar_bar_args=bar, **colours)
    for bone in moving.apply(time=angle):
        plotter.add_mesh(bone, color="ivory", smooth_shading=True, split_sharp_edges=True)
    plotter.add_text(f"{angle:.0f} degrees", font_size=12)
    plotter.view_vector((-1.0, 0.6, 0.1), viewup=(0, 0, 1))
    plotter.reset_camera(bounds=paths.apply(time=0.0).bounds)
    plotter.camera.zoom(0.9)
plotter.show()

# %%
# The mean, and the range over all paths.

angles = np.arange(0.0, 91.0, 15.0)
table = np.array([arms.apply(time=angle)["MomentArm"] for angle in angles])
figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.fill_between(angles, table.min(axis=1), table.max(axis=1), color="steelblue", alpha=0.25, linewidth=0)
axes.plot(angles, table.mean(axis=1), color="black")
axes.axhline(0.0, color="0.7", linewidth=0.8)
axes.set(xlabel="flexion [degrees]", ylabel="moment arm in flexion [mm]")
plt.show()
