"""Draw the pictures of docs/how_to/pipelines.rst: ``python docs/make_guide_pictures.py``."""

import runpy
from pathlib import Path

import pyvista as pv

ROOT = Path(__file__).parents[1]
NAMES = iter(("pipeline_three_lines.png", "pipeline_two_muscles.png"))


def save(plotter: pv.Plotter) -> None:
    """Write the picture instead of opening a window."""
    plotter.screenshot(ROOT / "docs/images" / next(NAMES))
    plotter.close()


pv.OFF_SCREEN = True
pv.Plotter.show = save
runpy.run_path(str(ROOT / "examples/plot_branching_pipeline.py"))
