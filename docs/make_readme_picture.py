"""Make docs/images/hip.png, the picture of the README, from the phantom hip."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from PIL import Image

from vtkmuscle import Scene, phantoms
from vtkmuscle.plotting import choose_view, make_plotter, strain_colours

PATH = Path(__file__).parent / "images" / "hip.png"
FRAMES = (0, 15, 30)
HEIGHT = 560  # pixels
COLOURS = 144


def main() -> None:
    """Run the phantom hip, and draw all muscles with their fibres at three angles, side by side."""
    result = Scene.from_phantom(phantoms.hip(), n_fibres=60).run(frames=f"0:{FRAMES[-1] + 1}")
    muscles = {i: [result.muscle(name, frame=i) for name in result.muscle_names] for i in FRAMES}
    view = choose_view(
        [muscle for i in FRAMES for muscle in muscles[i]],
        [result.bones(frame=i) for i in FRAMES for _ in result.muscle_names],
    )
    strips = []
    for i in FRAMES:
        fibres = pv.merge([result.fibres(name, frame=i) for name in result.muscle_names])
        lengths = [result.lengths[name] for name in result.muscle_names]
        strain = np.concatenate([100.0 * (table[i] / table[0] - 1.0) for table in lengths])
        plotter = make_plotter(
            result.bones(frame=i), muscles[i], view, fibres=fibres, colours=strain_colours(strain, limit=35.0)
        )
        picture = Image.fromarray(plotter.screenshot(return_img=True))
        plotter.close()
        strips.append(picture.resize((round(picture.width * HEIGHT / picture.height), HEIGHT), Image.LANCZOS))
    whole = Image.new("RGB", (sum(strip.width for strip in strips), HEIGHT), "white")
    x = 0
    for strip in strips:
        whole.paste(strip, (x, 0))
        x += strip.width
    PATH.parent.mkdir(exist_ok=True)
    whole.quantize(COLOURS, dither=Image.Dither.NONE).save(PATH, optimize=True)


if __name__ == "__main__":
    main()
