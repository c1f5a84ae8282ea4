"""
Two joints, and on to OpenSim
=============================

A strap runs in front of two hinges, as the rectus femoris does over hip and knee. The scene has both as
joints, and a grid of their coordinates moves the bones. Fibres pulled taut give moment arms about both. By
the rule that the strap is made of they are 26 and -18 mm at every pose; what is measured is within 3 % of
that (:doc:`/validation/how_right` says more). As a polynomial of both coordinates they go into a model of
OpenSim.
:doc:`/how_to/two_joints` has the keys of a scene, models of OpenSim and their motions.
"""

import tempfile
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import tomli_w

from vtkmuscle import Scene
from vtkmuscle.opensim import read_osim, write_opensim
from vtkmuscle.opensim.muscle_paths import moment_arm
from vtkmuscle.phantoms import strap_over_two_joints

phantom = strap_over_two_joints()
folder = Path(tempfile.mkdtemp())
scene_file = Scene.from_phantom(phantom, n_fibres=20, resolution=20).save(folder / "scene")

# %%
# The scene as it was saved moves its bones by tables. Here it gets joints instead.
tables = tomllib.loads(scene_file.read_text())
centres = {name: centre.tolist() for name, centre in phantom.known["centres"].items()}
hip = {"parent": "proximal", "child": "middle", "centre": centres["upper"], "axis": [-1, 0, 0]}
knee = {"parent": "middle", "child": "distal", "centre": centres["lower"], "axis": [1, 0, 0]}
hip |= {"type": "pin", "coordinates": {"hip_flexion": {"positive": "flexion", "range": [-40, 60]}}}
knee |= {"type": "pin", "coordinates": {"knee_angle": {"positive": "flexion", "range": [-20, 90]}}}
tables["joints"] = {"hip": hip, "knee": knee}
tables["motion"] = {"grid": {"hip_flexion": [0, 50, 10], "knee_angle": [0, 60, 10]}}
tables["model"] = "paths"
scene_file.write_text(tomli_w.dumps(tables))
result = Scene.load(scene_file).run()
arms = result.moment_arms()["strap"]

# %%
# Into OpenSim: one muscle for all fibres. The model, read again, has the moment arms.
(written,) = write_opensim(scene_file, folder / "strap.osim", result=result)
print(written)
model = read_osim(folder / "strap.osim")
values = {name: one.natural for name, one in result.motion.coordinates.items()}
figure, axes = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained", sharey=True)
for panel, name, known in zip(axes, arms, ("moment_arm_upper", "moment_arm_lower"), strict=True):
    again = 1000.0 * moment_arm(model.muscle("strap").path, model.tree, values, name)
    panel.plot(arms[name].values, arms[name].mean, "o", color="darkred", label="run, mean of the fibres")
    panel.plot(result.motion.coordinates[name].values, again, "k.", label="model of OpenSim")
    panel.axhline(phantom.known[known], color="black", linestyle="--", label="known")
    panel.set(xlabel=f"{name} [deg]", ylabel="moment arm, -dl/dq [mm]", ylim=(-30, 35))
axes[0].legend(frameon=False)
plt.show()
