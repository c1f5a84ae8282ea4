"""
Architecture from surfaces alone
================================

A segmentation often has muscles without bones, and no joint. :func:`vtkmuscle.init` then writes no scene that
runs, but a table: the volume of each muscle, and the lengths of its fascicles, with the published ratio of
fascicle to muscle and the range of people. Fibres run between the tips of each surface
(:doc:`/how_to/labels`).
"""

import tempfile

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pyvista as pv

import vtkmuscle
from vtkmuscle.phantoms import hip

folder = tempfile.mkdtemp()
muscles = hip(detail=0.5).muscles
for name, surface in muscles.items():
    pv.wrap(surface).save(f"{folder}/{name}.stl")
draft = vtkmuscle.init([f"{folder}/{name}.stl" for name in muscles], folder)
table = pd.read_csv(draft.file.parent / "volumes.csv").set_index("structure")
print(table[["volume_mm3", "fascicle_length_mm", "pcsa_mm2"]].round(1))

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), sharey=True, layout="constrained")
left.barh(table.index.str.replace("_", " "), table["volume_mm3"] / 1000.0, color="darkred")
left.set_xlabel("volume [cm³]")
fascicles = table[["fascicle_low_mm", "fascicle_length_mm", "fascicle_high_mm"]].to_numpy()
right.errorbar(
    fascicles[:, 1], left.get_yticks(), xerr=np.abs(np.diff(fascicles)).T, fmt="o", color="darkred"
)
right.set(xlabel="fascicle length [mm], range of people", xlim=(0, None))
plt.show()
