"""Run by pvbatch: a picture of bones, muscle and fibres. Arguments: folder, picture."""

import sys
from pathlib import Path

import paraview.simple as pv
from paraview_pipeline import pipeline_of_proxies
from scene_on_disk import TIMES


def main(folder, picture):
    chain = pipeline_of_proxies(folder)
    view = pv.CreateView("RenderView")
    view.ViewSize = [600, 600]
    view.Background = [1.0, 1.0, 1.0]
    view.UseColorPaletteForBackground = 0
    view.OrientationAxesVisibility = 0
    view.ViewTime = TIMES[-1]
    for name, colour, opacity in (
        ("moving", [0.9, 0.9, 0.8], 1.0),
        ("deformed", [0.8, 0.3, 0.3], 0.3),
        ("tubes", [0.6, 0.0, 0.0], 1.0),
    ):
        shown = pv.Show(chain[name], view)
        shown.Representation = "Surface"
        shown.ColorArrayName = ["POINTS", ""]
        shown.DiffuseColor = shown.AmbientColor = colour
        shown.Opacity = opacity
    view.CameraPosition, view.CameraFocalPoint = [600.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    view.CameraViewUp = [0.0, 0.0, 1.0]
    pv.ResetCamera(view)
    pv.SaveScreenshot(str(picture), view)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
