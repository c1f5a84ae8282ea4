"""
A model of OpenSim, enriched and used in OpenSim
================================================

A model has bodies and joints, and no muscle. A scene takes its joints from the model, a strap is pulled taut
over both of them at a grid of poses, and the muscle goes back into the model as a polynomial of the
coordinates, with Hill's parameters. Then OpenSim itself is asked for moment arms and a force; where the extra
``opensim`` is not installed this package reads the model, and there is no force.
"""

import importlib.util
import tempfile
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import tomli_w

from vtkmuscle import Scene
from vtkmuscle.core.motion.frames import frame_at
from vtkmuscle.core.motion.functions import IDENTITY
from vtkmuscle.core.motion.muscle_paths import moment_arm
from vtkmuscle.core.motion.tree import Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.export import osim_of, write_opensim
from vtkmuscle.io import read_osim
from vtkmuscle.phantoms import strap_over_two_joints

phantom, folder = strap_over_two_joints(), Path(tempfile.mkdtemp())
scene_file = Scene.from_phantom(phantom, n_fibres=20).save(folder)
hip, knee = (frame_at(phantom.known["centres"][name] / 1000.0) for name in ("upper", "lower"))
upper = Joint("hip", "ground", "thigh", [JointAxis((-1, 0, 0), IDENTITY, "flexion")], (), hip, hip)
lower = Joint("knee", "thigh", "shank", [JointAxis((1, 0, 0), IDENTITY, "bend")], (), knee, knee)
leg = KinematicTree("ground", [upper, lower], [JointCoordinate("flexion"), JointCoordinate("bend")])
(folder / "leg.osim").write_text(osim_of(leg, name="leg"))
tables = tomllib.loads(scene_file.read_text())
bodies = {"proximal": "ground", "middle": "thigh", "distal": "shank"}
tables |= {"opensim": {"model": "leg.osim", "bodies": bodies}, "model": "paths"}
tables["motion"] = {"grid": {"flexion": [0, 50, 10], "bend": [0, 60, 10]}}
hill = {"optimal_fibre_length": 90, "tendon_slack_length": 180, "pcsa": 12, "specific_tension": 61}
tables["muscles"]["strap"]["hill"] = hill
scene_file.write_text(tomli_w.dumps(tables))
(written,) = write_opensim(scene_file, folder / "enriched.osim", into=folder / "leg.osim")
print(written)

# %%
# The enriched model, asked over flexion of the upper joint; 26 mm are known.
angles = np.radians(np.arange(0.0, 51.0, 5.0))
model = read_osim(folder / "enriched.osim")
poses = {"flexion": angles, "bend": np.full(len(angles), np.radians(30.0))}
arms = {"this package": 1000.0 * moment_arm(model.muscle("strap").path, model.tree, poses, "flexion")}
if importlib.util.find_spec("opensim") is not None:
    import opensim

    theirs = opensim.Model(str(folder / "enriched.osim"))
    state, strap = theirs.initSystem(), theirs.getMuscles().get("strap")
    coordinates, found = theirs.updCoordinateSet(), []
    coordinates.get("bend").setValue(state, np.radians(30.0))
    for angle in angles:
        coordinates.get("flexion").setValue(state, angle)
        found.append(1000.0 * strap.computeMomentArm(state, coordinates.get("flexion")))
    arms["OpenSim"] = np.array(found)
    theirs.equilibrateMuscles(state)
    print(f"the strap pulls with {strap.getActuation(state):.0f} N in OpenSim")
_, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for style, (name, values) in zip(("k-", "ro"), arms.items(), strict=False):
    axes.plot(np.degrees(angles), values, style, label=name)
axes.set(xlabel="flexion [degrees]", ylabel="moment arm [mm]", ylim=(0, 32))
axes.legend(frameon=False)
plt.show()
