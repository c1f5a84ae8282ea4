"""
A gait cycle on a whole leg
===========================

The scene names an OpenSim model with the joints of a leg, and a ``.mot`` file with the walk; the run needs no
OpenSim. Bones and muscles are from ``leg.py`` in the same folder. The walk is synthetic: two harmonics per
joint. With your own files, begin at the scene.
"""

import tempfile
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pyvista as pv
import tomli_w
from leg import JOINTS, leg, leg_tree

from vtkmuscle import Scene
from vtkmuscle.opensim import osim_of

folder = Path(tempfile.mkdtemp())
scene_file = Scene.from_phantom(leg(coordinates=[(0, 0, 0)]), n_fibres=4).save(folder)
(folder / "leg.osim").write_text(osim_of(leg_tree()))

# %%
# The walk, in degrees: a constant, then cosine and sine of the cycle and of its double.
cycle = np.linspace(0.0, 1.0, 41)
turns = 2.0 * np.pi * (cycle + 0.25)  # of heel strike
waves = [np.ones(41), np.cos(turns), np.sin(turns), np.cos(2.0 * turns), np.sin(2.0 * turns)]
hip, knee, ankle = (12, 20, -6, -2, -1), (25, -3.5, -16, -17, 5), (-0.7, -0.8, 7, 1, -10)
walk = np.vstack([cycle, np.array([hip, knee, ankle]) @ waves]).T
columns = "inDegrees=yes\nendheader\ntime " + " ".join(JOINTS)
np.savetxt(folder / "walk.mot", walk, header=columns, comments="")
model = {"model": "leg.osim", "bodies": {"pelvis": "ground"}}
tables = {"opensim": model, "motion": {"file": "walk.mot"}, "deformer": "none"}
scene_file.write_text(tomli_w.dumps(tomllib.loads(scene_file.read_text()) | tables))
result = Scene.load(scene_file).run()

# %%
# The leg in mid-stance, at toe-off, in swing and at heel strike, stretched muscles in red; and all lengths.
plotter = pv.Plotter(shape=(1, 4), window_size=(1200, 640), border=False)
for panel, frame in enumerate((0, 15, 22, 30)):
    plotter.subplot(0, panel)
    plotter.add_mesh(result.bones(frame=frame), color="ivory", smooth_shading=True)
    for name in result.muscle_names:
        fibres, colours = result.fibres(name, frame=frame), {"cmap": "coolwarm", "clim": (-0.1, 0.1)}
        plotter.add_mesh(fibres, scalars="Strain", line_width=5, show_scalar_bar=False, **colours)
    plotter.view_vector((-1, -0.3, 0), viewup=(0, 0, 1))
    plotter.camera.zoom(1.7)
plotter.show()
_, axes = plt.subplots(figsize=(8, 4), layout="constrained")
for name, lengths in result.lengths.items():
    axes.plot(
        100.0 * cycle, 100.0 * (lengths.mean(axis=1) / lengths[0].mean() - 1.0), label=name.replace("_", " ")
    )
axes.set(xlabel="gait cycle from mid-stance [%]", ylabel="change of length [%]")
axes.legend(frameon=False, fontsize="small", loc="center left", bbox_to_anchor=(1, 0.5))
plt.show()
