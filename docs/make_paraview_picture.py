"""Make docs/images/paraview.png: the pipeline browser of ParaView with the stages of a muscle.

Needs ``paraview`` and ``Xvfb``; the picture is that of the X server's screen.
"""

from __future__ import annotations

import os
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

from vtkmuscle import Scene, phantoms
from vtkmuscle.paraview.environment import link_packages, settings

PATH = Path(__file__).resolve().parent / "images" / "paraview.png"
#: The screen, and the height of the picture: the list of stages takes a quarter of the height of the window.
SIZE = 1300, 1900
HEIGHT = 930
COLOURS = 160
#: Longest time until the script has ended [s].
PATIENCE = 600.0

SCRIPT = """
from paraview.simple import *

scene = MuscleScene(registrationName="MuscleScene", Scene={scene!r}, Muscle="gluteus_maximus")
muscle, bones, areas = (OutputPort(scene, name) for name in ("Surface", "Bones", "Attachments"))


def made(kind, **inputs):
    return kind(registrationName=kind.__name__, **inputs)


moving = made(BoneMotion, Bones=bones, Motion={scene!r})
fixed = made(FixedPointDetector, Muscle=muscle, Bones=bones, Attachments=areas)
template = made(FibreTemplateSource, Template="parallel", NFibres=100)
fitted = made(TemplateFitter, Template=template, Muscle=muscle, Attachments=areas)
morphed = made(SliceMorpher, Template=fitted, Muscle=muscle)
fibres = made(FibreTrimmer, Fibres=morphed, Muscle=muscle, Attachments=areas)
paths = made(TautPaths, RestFibres=fibres, RestMuscle=fixed, RestBones=bones, Bones=moving)
deformed = made(PathDeformer, Muscle=fixed, Paths=paths, RestBones=bones, Bones=moving, Fibres=fibres)
measured = made(FibreMetrics, Fibres=OutputPort(deformed, "CarriedFibres"))
tubes = made(FibreTubes, Fibres=measured, Radius=0.7)

view = GetActiveViewOrCreate("RenderView")
view.ViewTime = 40.0
view.OrientationAxesVisibility = 0
view.UseColorPaletteForBackground = 0
view.Background = [1, 1, 1]
GetLayout().SplitVertical(0, 0.42)
Show(moving, view)
Show(deformed, view).Opacity = 0.3
shown = Show(tubes, view)
ColorBy(shown, ("CELLS", "Strain"))
shown.RescaleTransferFunctionToDataRange()
view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [-0.4, 1, 0.2], [0, 0, 0], [0, 0, 1]
ResetCamera(view)
SetActiveSource(tubes)
Render(view)
open({done!r}, "w").close()
"""


def screen(file: Path) -> Image.Image:
    """Return the picture in a framebuffer of Xvfb: an XWD file of 32 bits a pixel."""
    data = file.read_bytes()
    header = np.frombuffer(data[:100], ">u4")
    width, height, stride, colours = header[4], header[5], header[12], header[19]
    pixels = np.frombuffer(data, np.uint8, offset=int(header[0] + 12 * colours), count=int(stride * height))
    return Image.fromarray(pixels.reshape(height, -1, 4)[:, :width, 2::-1].copy())


def main() -> None:
    """Start ParaView on a screen of its own, let it make the pipeline, and write the screen's picture."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        hip = Scene.from_phantom(phantoms.hip())
        done, script = folder / "done", folder / "pipeline.py"
        script.write_text(
            SCRIPT.format(scene=str(hip.save(folder / "scene")), done=str(done)), encoding="utf-8"
        )
        said = subprocess.run(["pvpython", "--version"], capture_output=True, text=True, check=True).stdout
        welcome = folder / ".config" / "ParaView" / f"ParaView{said.split()[-1]}.ini"
        welcome.parent.mkdir(parents=True)
        welcome.write_text("[General]\nGeneralSettings.ShowWelcomeDialog=false\n", encoding="utf-8")
        link_packages(folder / "packages")
        own = {key: os.pathsep.join(map(str, paths)) for key, paths in settings(folder / "packages").items()}
        environment = {**os.environ, **own, "DISPLAY": ":87", "HOME": str(folder), "QT_QPA_PLATFORM": "xcb"}
        size = "x".join(map(str, SIZE))
        commands = (
            ["Xvfb", ":87", "-screen", "0", f"{size}x24", "-fbdir", str(folder)],
            ["paraview", "-qwindowgeometry", f"{size}+0+0", f"--script={script}"],
        )
        processes = []
        try:
            for command in commands:
                processes.append(subprocess.Popen(command, env=environment))
                time.sleep(2.0)
            end = time.monotonic() + PATIENCE
            while not done.exists():
                if time.monotonic() > end or processes[-1].poll() is not None:
                    raise RuntimeError("ParaView has not made the pipeline")
                time.sleep(1.0)
            time.sleep(10.0)  # until the windows are drawn
            picture = screen(folder / "Xvfb_screen0").crop((0, 0, SIZE[0], HEIGHT))
        finally:
            for process in reversed(processes):
                process.terminate()
                process.wait()
    picture.quantize(COLOURS, dither=Image.Dither.NONE).save(PATH, optimize=True)


if __name__ == "__main__":
    main()
