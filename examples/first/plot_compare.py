"""
Two hips compared
=================

Does a larger femoral head move the iliacus away from the joint? :func:`vtkmuscle.compare` matches muscles and
coordinates by name and gives the differences; ``write`` writes a table and a figure. Settings, sides
and published moment arms are compared in the same way.
"""

import matplotlib.pyplot as plt

import vtkmuscle
from vtkmuscle.phantoms import hip

runs = {}
for radius in (21.0, 26.0):
    phantom = hip(head_radius=radius, angles=range(0, 91, 15), detail=0.4)
    scene = vtkmuscle.Scene.from_phantom(phantom, n_fibres=30).with_muscles("iliacus")
    runs[f"head of {radius:g} mm"] = scene.run()
compared = vtkmuscle.compare(runs)
table = compared.table().where(run="head of 26 mm")
for quantity, apart in zip(table["quantity"], table["difference"], strict=True):
    print(f"{quantity}: {apart:+.1f} mm on the mean")

# %%
figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
for panel, (quantity, curves) in zip(axes, list(compared.curves["iliacus"].items())[1:], strict=True):
    for name, curve in curves.items():
        panel.plot(curve.x, curve.mean, label=name)
    panel.set(xlabel=curve.over, ylabel=f"{quantity} [{curve.unit}]")
axes[0].legend(frameon=False)
plt.show()
