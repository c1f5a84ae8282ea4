"""
Fibres that end on their attachment areas
=========================================

Fibres mapped section by section into a muscle crowd in the tips, or hook at the last sections. The trimmer
cuts the ends at planes through the attachment areas, and moves the ends to points spread over the areas; the
smoother removes the bends. After Kohout, Clapworthy, Martelli, Viceconti 2012, figures 8 and 9.
"""

import numpy as np
import pyvista as pv

from vtkmuscle.filters import (
    FibreMetrics,
    FibreSmoother,
    FibreTemplateSource,
    FibreTrimmer,
    FibreTubes,
    SliceMorpher,
    TemplateFitter,
)
from vtkmuscle.phantoms import hip

phantom = hip()
name = "gluteus_medius"
muscle, attachments = phantom.muscles[name], phantom.attachments[name]
fitted = TemplateFitter()(FibreTemplateSource(n_fibres=80), muscle, attachments)
morphed = SliceMorpher()(fitted, muscle, attachments)
trimmed = FibreTrimmer()(morphed, muscle, attachments)
smoothed = FibreSmoother()(trimmed, muscle)


def nearest_ends(fibres):
    """Return the mean distance between nearest first points of fibres."""
    lines = pv.wrap(fibres).points.reshape(fibres.GetNumberOfCells(), -1, 3)
    gaps = np.linalg.norm(lines[:, None, 0] - lines[None, :, 0], axis=2)
    return np.sort(gaps, axis=1)[:, 1].mean()


stages = {"morphed": morphed, "trimmed": trimmed, "smoothed": smoothed}
for stage, fibres in stages.items():
    length = pv.wrap(FibreMetrics()(fibres)).cell_data["Length"]
    print(f"{stage:8s} {length.mean():.1f} mm long, sd {length.std():.1f}", end="")
    print(f"; ends {nearest_ends(fibres):.2f} mm apart")

# %%
# Morphed, trimmed and smoothed fibres.
plotter = pv.Plotter(shape=(1, 3), window_size=(1400, 560), border=False)
for column, (stage, fibres) in enumerate(stages.items()):
    plotter.subplot(0, column)
    tubes = FibreTubes(radius=1.5).apply(FibreMetrics()(fibres, muscle))
    bar = {"title": "length [mm]", "fmt": "%.0f", "n_labels": 3, "position_y": 0.01}
    plotter.add_mesh(tubes, scalars="Length", show_scalar_bar=column == 1, scalar_bar_args=bar)
    plotter.add_mesh(pv.wrap(muscle), color="darkred", opacity=0.15, smooth_shading=True)
    plotter.add_text(stage, position=(10, 520), font_size=12)
plotter.link_views()
plotter.view_vector((-1, 0.2, 0.1), viewup=(0, 0, 1))
plotter.camera.zoom(1.15)
plotter.show()
