"""
Two ways to deform a muscle
===========================

The gluteus maximus of the phantom hip, carried by taut paths and deformed by position based dynamics: shape,
time and moment arms (:doc:`/explanation/deformers`).
"""

import time

import numpy as np
import pyvista as pv

from vtkmuscle import filters, phantoms
from vtkmuscle.pipelines import decompose

hip = phantoms.hip()
muscle, areas = hip.muscles["gluteus_maximus"], hip.attachments["gluteus_maximus"]
fixed = filters.FixedPointDetector(muscle=muscle, bones=hip.bones, attachments=areas)
bones = {"rest_bones": hip.bones, "bones": filters.BoneMotion(bones=hip.bones, motion=hip.motion)}
rest = decompose(fixed, areas, n_fibres=60)
paths = filters.TautPaths(rest_fibres=rest, rest_muscle=fixed, **bones)
deformers = {
    "taut paths": filters.PathDeformer(muscle=fixed, paths=paths, measure_shape=True, **bones),
    "position based dynamics": filters.PBDDeformer(muscle=fixed, fibres=rest, measure_shape=True, **bones),
}

# %%
# Each deformer computes 30 frames of 2 degrees. The time is processor time, paths included.

surfaces = {}
for name, deformer in deformers.items():
    deformer.update(time=0.0)
    began = time.process_time()
    for angle in np.arange(2.0, 61.0, 2.0):
        deformer.update(time=angle)
    milliseconds = 1000.0 * (time.process_time() - began) / 30
    surfaces[name] = shape = deformer.apply(time=60.0)
    volume, stretch, angles = (shape[key][0] for key in ("VolumeRatio", "EdgeStretchMax", "DihedralErrorP95"))
    print(f"{name}: {milliseconds:.0f} ms a frame, volume within {abs(volume - 1.0):.0e}")
    print(f"longest edge {stretch:.1f} times its length, 95 % of the angles within {angles:.0f} degrees")

# %%
# Moment arms are -dl/dq: levers for paths, differences of length for fibres in the surface.

fibres = {"rest_fibres": rest, "rest_muscle": fixed}
moved = filters.FibreTransport(deformed_muscle=deformers["position based dynamics"], **fibres)
for name, source in (("taut paths", paths), ("position based dynamics", moved)):
    arms = filters.MomentArms(fibres=source, motion=hip.motion).apply(time=30.0)["MomentArm"]
    print(f"{name}: moment arm at 30 degrees {arms.mean():.1f} mm ({arms.min():.1f} to {arms.max():.1f})")

plotter = pv.Plotter(shape=(1, 2), window_size=(1100, 620), border=False)
for column, (name, surface) in enumerate(surfaces.items()):
    plotter.subplot(0, column)
    for bone in bones["bones"].apply(time=60.0):
        plotter.add_mesh(bone, color="ivory", smooth_shading=True, split_sharp_edges=True)
    plotter.add_mesh(surface, color="indianred", smooth_shading=True)
    plotter.add_text(name, font_size=12)
    plotter.view_vector((-1.0, 0.6, 0.1), viewup=(0, 0, 1))
plotter.show()
