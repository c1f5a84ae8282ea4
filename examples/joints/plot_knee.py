"""
A knee and its muscles
======================

Five muscles of a phantom leg cross the knee, four of them a second joint. Pulled taut round the condyles over
90 degrees of flexion, the muscles have moment arms about the knee. The condyles are a roller of 21 mm, the
least moment arm of a tendon in front of the knee. The surfaces of an anatomical atlas are not shown here, for
licence reasons; with the atlas, the long head of the biceps has 15 to 50 mm over the same range
(:doc:`/validation/how_right` has five more muscles).
"""

import matplotlib.pyplot as plt
import numpy as np
import pyvista as pv
from leg import CONDYLE, leg

from vtkmuscle import RigidMotion, Scene
from vtkmuscle.core.motion.coordinates import Coordinate

flexion = np.arange(0.0, 91.0, 7.5)
phantom = leg(coordinates=np.column_stack([0.0 * flexion, flexion, 0.0 * flexion]))
knee = RigidMotion(
    flexion,
    {bone: phantom.motion.transforms[bone] for bone in ("tibia", "foot")},
    phantom.known["centres"]["knee_flexion"],
    {"knee_flexion": Coordinate(flexion, "deg", "flexion")},
)
crossing = ("rectus_femoris", "vastus", "biceps_femoris", "semitendinosus", "gastrocnemius")
whole = Scene.from_phantom(phantom, n_fibres=12)
scene = Scene("knee", whole.bones, {name: whole.muscles[name] for name in crossing}, knee, deformer="none")
result = scene.run()

# %%
# From the side: straight, half bent and bent.
plotter = pv.Plotter(shape=(1, 3), window_size=(1200, 500), border=False)
for panel, frame in enumerate((0, 6, 12)):
    plotter.subplot(0, panel)
    plotter.add_mesh(result.bones(frame=frame), color="ivory")
    for name, colour in zip(crossing, ("firebrick", "coral", "navy", "teal", "olive"), strict=True):
        plotter.add_mesh(result.fibres(name, frame=frame), color=colour, line_width=3)
    plotter.view_vector((-1, 0, 0), viewup=(0, 0, 1))
    plotter.camera.focal_point, plotter.camera.parallel_scale = (-14, 0, -412), 170
    plotter.camera.parallel_projection = True
plotter.show()

# %%
# Moment arms, positive in flexion. The muscles in front of the knee run round the roller.
_, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for name, arms in result.moment_arms().items():
    axes.plot(arms["knee_flexion"].values, arms["knee_flexion"].mean, label=name)
axes.axhline(-CONDYLE, color="grey", linestyle=":", label="surface of the roller, in front")
axes.set(xlabel="knee flexion [degrees]", ylabel="moment arm, -dl/dq [mm]")
axes.legend(frameon=False, fontsize="small")
plt.show()
