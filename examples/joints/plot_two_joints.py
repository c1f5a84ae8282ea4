"""
Two joints, and on to OpenSim
=============================

The rectus femoris crosses hip and knee. The scene has both joints, and a grid of both coordinates moves the
bones. Taut paths give moment arms about both joints (accuracy: :doc:`/validation/how_right`), exported as
polynomials of both coordinates to an OpenSim model. :doc:`/how_to/two_joints` has the keys of the scene.
"""

import tempfile
import tomllib
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import tomli_w
from leg import leg

from vtkmuscle import Scene
from vtkmuscle.opensim import export, read_osim
from vtkmuscle.opensim.muscle_paths import moment_arm

phantom = leg()
folder = Path(tempfile.mkdtemp())
scene = Scene.from_phantom(phantom, n_fibres=20, resolution=20)
scene = replace(scene, muscles={"rectus_femoris": scene.muscles["rectus_femoris"]})
scene_file = scene.save(folder / "scene")

# %%
# The saved scene moves the bones by tables. The example replaces the tables by joints, without the foot.
tables = tomllib.loads(scene_file.read_text())
del tables["bones"]["foot"]
centres = {name: centre.tolist() for name, centre in phantom.known["centres"].items()}
hip = {"parent": "pelvis", "child": "femur", "centre": centres["hip_flexion"], "axis": [-1, 0, 0]}
knee = {"parent": "femur", "child": "tibia", "centre": centres["knee_flexion"], "axis": [1, 0, 0]}
hip |= {"type": "pin", "coordinates": {"hip_flexion": {"positive": "flexion", "range": [-20, 90]}}}
knee |= {"type": "pin", "coordinates": {"knee_angle": {"positive": "flexion", "range": [0, 90]}}}
tables["joints"] = {"hip": hip, "knee": knee}
tables["motion"] = {"grid": {"hip_flexion": [0, 50, 10], "knee_angle": [0, 60, 10]}}
tables["deformer"] = "none"
scene_file.write_text(tomli_w.dumps(tables))
result = Scene.load(scene_file).run()
arms = result.moment_arms()["rectus_femoris"]

# %%
# Export to OpenSim: a single muscle for all fibres. The exported model has the moment arms.
(written,) = export(result, folder / "rectus_femoris.osim")
print(written)
model = read_osim(folder / "rectus_femoris.osim")
values = {name: one.natural for name, one in result.motion.coordinates.items()}
figure, axes = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained", sharey=True)
for panel, name in zip(axes, arms, strict=True):
    again = 1000.0 * moment_arm(model.muscle("rectus_femoris").path, model.tree, values, name)
    panel.plot(arms[name].values, arms[name].mean, "o", color="darkred", label="run, mean of the fibres")
    panel.plot(result.motion.coordinates[name].values, again, "k.", label="model of OpenSim")
    panel.set(xlabel=f"{name.replace('_', ' ')} [degrees]", ylabel="moment arm [mm]")
axes[0].legend(frameon=False)
plt.show()
