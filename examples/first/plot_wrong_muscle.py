"""
A muscle that went wrong
========================

A single iteration of Algorithm 2 in each step is far too few: the fixed ends follow the bone, and the belly
stays behind. The verdict names the fault, the frame and a remedy. Colours show the change of edge lengths.
"""

from dataclasses import replace

import numpy as np
import pyvista as pv

from vtkmuscle import Scene, phantoms

scene = Scene.from_phantom(phantoms.spindle_over_hinge(), n_fibres=20)
hasty = replace(scene, deformer="pbd", quality="published", solver={"iterations": 1})
runs = {"as it should be": scene.run(), "one iteration": hasty.run()}
plotter = pv.Plotter(shape=(1, 2), window_size=(1000, 650), border=False)
for column, (name, result) in enumerate(runs.items()):
    one = result["spindle"]
    print(f"{name}: {one.verdict}", *one.reasons, sep="\n  ")
    frame = result.frames[result.finished("spindle") - 1]
    muscle, rest = one.surface(frame=frame), result.rest_muscle("spindle")
    sizes = [mesh.compute_cell_sizes(length=False, volume=False)["Area"] for mesh in (muscle, rest)]
    muscle["stretch"] = 100.0 * (np.sqrt(sizes[0] / sizes[1]) - 1.0)
    plotter.subplot(0, column)
    plotter.add_mesh(result.bones(frame=frame), color="ivory")
    bar = {"title": "stretch of the surface [%]", "fmt": "%.0f", "n_labels": 3, "title_font_size": 16}
    plotter.add_mesh(muscle, scalars="stretch", cmap="coolwarm", clim=(-60, 60), scalar_bar_args=bar)
    plotter.add_text(name, font_size=10)
    plotter.view_yz()
    plotter.camera.zoom(1.7)
plotter.show()
