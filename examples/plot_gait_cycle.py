"""
A walk from OpenSim, and back into its model
============================================

A model of OpenSim has the joints of a leg, a ``.mot`` file its walk; the muscle is a strap over both joints.
The scene names them, and needs no OpenSim to be run. Fibre lengths over the cycle come out, and the muscle
goes back into the model as a path, worth what the walk has gone through. Model and walk are made here; with
your own, begin at the scene.
"""

import tempfile
import tomllib
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import tomli_w

from vtkmuscle import Scene
from vtkmuscle.core.motion.frames import frame_at
from vtkmuscle.core.motion.functions import IDENTITY
from vtkmuscle.core.motion.tree import Joint, JointAxis, JointCoordinate, KinematicTree
from vtkmuscle.export import osim_of, write_opensim
from vtkmuscle.phantoms import strap_over_two_joints

phantom = strap_over_two_joints()
folder = Path(tempfile.mkdtemp())
scene_file = Scene.from_phantom(phantom, n_fibres=20, resolution=20).save(folder)

# %%
# The model, in metres, and a cycle from mid-stance on, roughly as people walk, in degrees.
hip, knee = (frame_at(phantom.known["centres"][name] / 1000.0) for name in ("upper", "lower"))
flexion, bend = JointAxis((-1, 0, 0), IDENTITY, "flexion"), JointAxis((1, 0, 0), IDENTITY, "bend")
upper = Joint("hip", "ground", "thigh", [flexion], (), hip, hip)
lower = Joint("knee", "thigh", "shank", [bend], (), knee, knee)
leg = KinematicTree("ground", [upper, lower], [JointCoordinate("flexion"), JointCoordinate("bend")])
(folder / "leg.osim").write_text(osim_of(leg, name="leg"))
cycle = np.linspace(0.0, 1.0, 41)
sine, cosine = np.sin(2.0 * np.pi * cycle), np.cos(2.0 * np.pi * cycle)
walk = np.column_stack([cycle, 4.0 - 20.0 * sine, 24.0 - 16.0 * cosine + 13.0 * sine * (1.0 - cosine)])
np.savetxt(folder / "walk.mot", walk, header="inDegrees=yes\nendheader\ntime flexion bend", comments="")

# %%
# The scene: model and motion, and which body each bone is.
tables = tomllib.loads(scene_file.read_text())
bodies = {"proximal": "ground", "middle": "thigh", "distal": "shank"}
tables |= {"opensim": {"model": "leg.osim", "bodies": bodies}, "motion": {"file": "walk.mot"}}
tables["model"] = "paths"
scene_file.write_text(tomli_w.dumps(tables))
result = Scene.load(scene_file).run()
enriched = folder / "leg_with_strap.osim"
(written,) = write_opensim(scene_file, enriched, result=result, into=folder / "leg.osim")
print(written)
figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
known = np.array([phantom.known["length"](*pose) for pose in walk[:, 1:]])
for lengths, style, label in ((result.lengths["strap"].mean(axis=1), "-", "run"), (known, "k--", "known")):
    axes.plot(100.0 * cycle, lengths - lengths[0], style, label=label)
axes.set(xlabel="gait cycle [%]", ylabel="change of length [mm]")
axes.legend(frameon=False)
plt.show()
