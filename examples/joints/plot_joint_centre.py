"""
A joint's centre beside the head
================================

Moment arms are off by as much as a joint's centre is. Here a phantom hip turns about the centre of the
femoral head, and about centres 5 and 10 mm in front of it. The check of a scene fits a ball to the head, and
warns of the last: more than a quarter of the ball's radius is more than a fit is off.
"""

import warnings
from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np

from vtkmuscle import Scene, hinge, phantoms

angles = np.arange(0, 91, 10)
scene = Scene.from_phantom(phantoms.hip(angles=angles), n_fibres=30).with_muscles("gluteus_maximus")
(name,) = scene.motion.coordinates
figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
for forward in (0, 5, 10):
    motion = hinge("femur", (0, -forward, 0), (-1, 0, 0), angles, coordinate=name)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = replace(scene, motion=motion).run()
    warned = any("the centre of its head" in str(warning.message) for warning in caught)
    arms = result["gluteus_maximus"].moment_arms[name]
    label = f"{forward} mm in front of the head's centre" + (", warned of" if warned else "")
    axes.plot(arms.values, arms.mean, label=label)
axes.set_xlabel("hip flexion [degrees]")
axes.set_ylabel("mean moment arm, gluteus maximus [mm]")
axes.legend()
plt.show()
