"""
Two joints, and on to OpenSim
=============================

A strap runs in front of two hinges, as the rectus femoris does over hip and knee. The scene has both as
joints, and a grid of their coordinates moves the bones. Fibres pulled taut give moment arms about both. By
the rule that the strap is made of they are 26 and -18 mm at every pose; what is measured is 7 and 4 % short
(:doc:`/how_right` says more of that). As a polynomial of both coordinates they go into a model of OpenSim.
:doc:`/joints` has the keys of a scene, models of OpenSim and their motions.
"""

import tempfile
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import tomli_w

from vtkmuscle import Scene
from vtkmuscle.core.motion.muscle_paths import moment_arm
from vtkmuscle.export import write_opensim
from vtkmuscle.io import read_osim
from vtkmuscle.phantoms import strap_over_two_joints

phantom = strap_over_two_joints()
folder = Path(tempfile.mkdtemp())
scene_file = Scene.from_phantom(phantom, n_fibres=20, resolution=20).save(folder / "scene")

# %%
# The scene as it was saved moves its bones by tables. Here it gets joints instead: a hip, which flexes the
# thigh to the front, and a knee, which flexes the shank to the back.

tables = tomllib.loads(scene_file.read_text())
tables["joints"] = {
    "hip": {
        "parent": "proximal",
        "child": "middle",
        "type": "pin",
        "centre": [0.0, 0.0, 0.0],
        "axis": [-1.0, 0.0, 0.0],
        "coordinates": {"hip_flexion": {"range": [-40, 60], "positive": "flexion"}},
    },
    "knee": {
        "parent": "middle",
        "child": "distal",
        "type": "pin",
        "centre": phantom.known["centres"]["lower"].tolist(),
        "axis": [1.0, 0.0, 0.0],
        "coordinates": {"knee_angle": {"range": [-20, 90], "positive": "flexion"}},
    },
}
tables["motion"] = {"grid": {"hip_flexion": [0, 50, 10], "knee_angle": [0, 60, 10]}}
tables["model"] = "paths"
scene_file.write_text(tomli_w.dumps(tables))
result = Scene.load(scene_file).run()
print(result.moment_arms())

# %%
# Into OpenSim: one muscle for all fibres, its length a polynomial of both coordinates.

(written,) = write_opensim(scene_file, folder / "strap.osim", result=result)
print(written)

# %%
# The model, read again, has the moment arms.

model = read_osim(folder / "strap.osim")
values = {name: one.natural for name, one in result.motion.coordinates.items()}
figure, axes = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained", sharey=True)
known = {"hip_flexion": phantom.known["moment_arm_upper"], "knee_angle": phantom.known["moment_arm_lower"]}
for panel, (name, arm) in zip(axes, known.items(), strict=True):
    arms = 1000.0 * moment_arm(model.muscle("strap").path, model.tree, values, name)
    measured = result.moment_arms()["strap"][name]
    panel.plot(measured.values, measured.mean, "o", color="darkred", label="run, mean of the fibres")
    panel.plot(result.motion.coordinates[name].values, arms, "k.", label="model of OpenSim")
    panel.axhline(arm, color="black", linestyle="--", label="known")
    panel.set(xlabel=f"{name} [deg]", ylim=(-30, 35))
axes[0].set(ylabel="moment arm, -dl/dq [mm]")
axes[0].legend(frameon=False)
plt.show()
