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
from vtkmuscle.io import fibre_summary
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


for stage, fibres in (("morphed", morphed), ("trimmed", trimmed), ("smoothed", smoothed)):
    length = fibre_summary(FibreMetrics()(fibres))["Length"]
    print(f"{stage:8s} {length['mean']:.1f} mm long, sd {length['sd']:.1f}", end="")
    print(f"; ends {nearest_ends(fibres):.2f} mm apart")

# %%
# Morphed, trimmed and smoothed fibres.
plotter = pv.Plotter(shape=(1, 3), border=False)
for column, fibres in enumerate((morphed, trimmed, smoothed)):
    plotter.subplot(0, column)
    measured = FibreMetrics()(fibres, muscle)
    tubes = FibreTubes(radius=1.5)(measured)
    plotter.add_mesh(pv.wrap(tubes), scalars="Length", smooth_shading=True, show_scalar_bar=column == 1)
    plotter.add_mesh(pv.wrap(muscle), color="darkred", opacity=0.15)
plotter.link_views()
plotter.view_yz()
plotter.show()
