"""
A known moment arm
==================

A strap lies on a cylinder that turns and winds it up. The moment arm of a fibre in the middle of the strap
is the radius of the cylinder and half the thickness of the strap, at every angle; that of the muscle is
measured here as the change of fibre length by angle.
"""

import matplotlib.pyplot as plt
import numpy as np

from vtkmuscle import Scene
from vtkmuscle.phantoms import wrapping_cylinder

phantom = wrapping_cylinder()
result = Scene.from_phantom(phantom, n_fibres=30).run()
angles, lengths = np.radians(result.times), result.lengths["strap"]
measured = -np.gradient(lengths.mean(axis=1), angles)
known = phantom.known["moment_arm"]
print(f"moment arm: known {known:.1f} mm, measured {measured.mean():.1f} mm on average")

# %%
figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
axes.plot(result.times, measured, color="darkred", label="measured, mean of all fibres")
axes.axhline(known, color="black", linestyle="--", label="known")
axes.set(xlabel="angle [degrees]", ylabel="moment arm [mm]", ylim=(1.5 * known, 0.0))
axes.legend(frameon=False)
plt.show()
