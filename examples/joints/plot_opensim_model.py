"""
An OpenSim model, enriched and used in OpenSim
==============================================

A scene takes joints from an OpenSim model without muscles. A muscle over hip and knee is pulled taut at a
grid of poses, and added to the model as a polynomial of both coordinates, with Hill's parameters. OpenSim
then computes moment arms and a force; without the extra ``opensim`` only vtkmuscle reads the model.
"""

import tempfile
import tomllib
from contextlib import suppress
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import tomli_w
from leg import leg, leg_tree

from vtkmuscle import Scene
from vtkmuscle.opensim import export, osim_of, read_osim
from vtkmuscle.opensim.muscle_paths import moment_arm

folder = Path(tempfile.mkdtemp())
scene_file = Scene.from_phantom(leg(coordinates=[(0, 0, 0)]), n_fibres=12).save(folder)
(folder / "leg.osim").write_text(osim_of(leg_tree()))
tables = tomllib.loads(scene_file.read_text()) | {"deformer": "none"}
tables["opensim"] = {"model": "leg.osim", "bodies": {"pelvis": "ground"}}
tables["motion"] = {"grid": {"hip_flexion": [0, 60, 10], "knee_flexion": [0, 60, 10]}}
hill = {"optimal_fibre_length": 80, "tendon_slack_length": 415, "pcsa": 14, "specific_tension": 61}
tables["muscles"] = {"rectus_femoris": tables["muscles"]["rectus_femoris"] | {"hill": hill}}
del tables["bones"]["foot"]
scene_file.write_text(tomli_w.dumps(tables))
print(*export(scene_file, folder / "enriched.osim", into=folder / "leg.osim"))

# %%
# The enriched model over flexion of the hip: the muscle flexes the hip, and extends the knee.
angles = np.radians(np.arange(0.0, 61.0, 5.0))
model, poses = read_osim(folder / "enriched.osim"), {"hip_flexion": angles, "knee_flexion": 0.5 * angles}
path, names = model.muscle("rectus_femoris").path, ("hip_flexion", "knee_flexion")
_, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for name in names:
    arms = 1000.0 * moment_arm(path, model.tree, poses, name)
    axes.plot(np.degrees(angles), arms, label=name.replace("_", " "))
with suppress(ModuleNotFoundError):
    import opensim

    theirs = opensim.Model(str(folder / "enriched.osim"))
    state, muscle = theirs.initSystem(), theirs.getMuscles().get("rectus_femoris")
    coordinates = [theirs.updCoordinateSet().get(name) for name in names]
    for hip in angles:
        for one, angle in zip(coordinates, (hip, 0.5 * hip), strict=True):
            one.setValue(state, angle)
        arms = [1000.0 * muscle.computeMomentArm(state, one) for one in coordinates]
        axes.plot(np.degrees([hip, hip]), arms, "k.")
    theirs.equilibrateMuscles(state)
    print(f"the dots are OpenSim's; there it pulls with {muscle.getActuation(state):.0f} N")
axes.set(xlabel="hip flexion [degrees], the knee half as much", ylabel="moment arm [mm]")
axes.legend(frameon=False)
plt.show()
