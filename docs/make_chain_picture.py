"""Make docs/images/chain.png, the picture of the README's chain of filters, by the gallery's example."""

from __future__ import annotations

import runpy
from pathlib import Path

import pyvista as pv
from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
EXAMPLE = ROOT / "examples" / "first" / "plot_papers_chain.py"
PATH = ROOT / "docs" / "images" / "chain.png"
COLOURS = 144


def main() -> None:
    """Run the example off-screen, and write its picture with few colours."""
    pv.OFF_SCREEN = True
    plotter = runpy.run_path(str(EXAMPLE))["plotter"]
    picture = Image.fromarray(plotter.image)
    PATH.parent.mkdir(exist_ok=True)
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(PATH, optimize=True)


if __name__ == "__main__":
    main()
