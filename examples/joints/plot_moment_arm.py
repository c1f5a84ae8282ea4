"""
A known moment arm
==================

A strap is wound up by a turning cylinder. The moment arm of a path in the middle of the strap is the radius
of the cylinder plus half the thickness of the strap, at every angle. The sign is negative: the strap
lengthens with the angle. :meth:`Result.moment_arms` has the levers of all paths; the mean is within 0.3 mm.
:doc:`/validation/how_right` compares further phantoms, with larger errors.
"""

import matplotlib.pyplot as plt

from vtkmuscle import Scene
from vtkmuscle.phantoms import wrapping_cylinder

phantom = wrapping_cylinder()
result = Scene.from_phantom(phantom, n_fibres=30).run()
(measured,) = result.moment_arms()["strap"].values()
known = phantom.known["moment_arm"]
print(f"moment arm: known {known:.1f} mm, measured {measured.mean.mean():.1f} mm on average")

# %%
figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
axes.fill_between(
    measured.values,
    measured.arms.min(axis=1),
    measured.arms.max(axis=1),
    color="darkred",
    alpha=0.2,
    linewidth=0,
    label="measured, all paths",
)
axes.plot(measured.values, measured.mean, color="darkred", label="measured, mean")
axes.axhline(known, color="black", linestyle="--", label="known")
axes.set(xlabel=result.time_label, ylabel="moment arm [mm]", ylim=(1.5 * known, 0.0))
axes.legend(frameon=False)
plt.show()
