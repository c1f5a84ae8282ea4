"""
A template of your own
======================

A small TOML (or JSON) file defines further kinds of fibres: corners of *sheets* of control points in the unit
cube, from the origin area to the insertion area. The example has two heads with an origin area each; the
fibres cross to the far halves of a common insertion. A scene names the file by
``fibres = { template_file = "crossing_heads.toml" }``.
"""

import tempfile
from pathlib import Path

import pyvista as pv

from vtkmuscle.filters import FibreTemplateSource
from vtkmuscle.phantoms import fibre_block
from vtkmuscle.pipelines import decompose

TEMPLATE = """
[[parts]]                                                                   # the left head
sheets = [
    [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0], [0.4, 1.0, 0.0], [0.0, 1.0, 0.0]],   # the origin area
    [[0.0, 0.0, 0.4], [0.4, 0.0, 0.4], [0.4, 1.0, 0.4], [0.0, 1.0, 0.4]],
    [[0.5, 0.0, 0.6], [1.0, 0.0, 0.6], [1.0, 0.5, 0.6], [0.5, 0.5, 0.6]],
    [[0.5, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.5, 1.0], [0.5, 0.5, 1.0]],   # the insertion area
]

[[parts]]                                                                   # the right head
sheets = [
    [[0.6, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.6, 1.0, 0.0]],
    [[0.6, 0.0, 0.4], [1.0, 0.0, 0.4], [1.0, 1.0, 0.4], [0.6, 1.0, 0.4]],
    [[0.0, 0.5, 0.6], [0.5, 0.5, 0.6], [0.5, 1.0, 0.6], [0.0, 1.0, 0.6]],
    [[0.0, 0.5, 1.0], [0.5, 0.5, 1.0], [0.5, 1.0, 1.0], [0.0, 1.0, 1.0]],
]
"""

file = Path(tempfile.mkdtemp()) / "crossing_heads.toml"
file.write_text(TEMPLATE, encoding="utf-8")
cube = pv.wrap(FibreTemplateSource(template_file=str(file), n_fibres=80).update().output)
phantom = fibre_block("parallel")
muscle, attachments = phantom.muscles["block"], phantom.attachments["block"]
fibres = pv.wrap(decompose(muscle, attachments, template_file=str(file), n_fibres=80).update().output)

plotter = pv.Plotter(shape=(1, 2), window_size=(900, 500), border=False)
for column, (lines, radius, outline) in enumerate(
    [(cube, 0.008, pv.Cube(bounds=(0, 1, 0, 1, 0, 1))), (fibres, 0.35, pv.wrap(muscle))]
):
    plotter.subplot(0, column)
    plotter.add_mesh(outline.extract_feature_edges(30), color="grey")
    plotter.add_mesh(
        lines.tube(radius=radius), scalars="r", cmap="coolwarm", show_scalar_bar=False, smooth_shading=True
    )
    plotter.view_vector((0.4, -1.0, 0.3), viewup=(0, 0, 1))
plotter.show()
