"""A window off the screen in which pictures are taken one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Self

import numpy as np
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 -- what windows and mappers are made of
from numpy.typing import NDArray
from PIL import Image
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger, vtkUnsignedCharArray
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import vtkActor, vtkCamera, vtkRenderer, vtkRenderWindow

from vtkmuscle.core.types import Floats
from vtkmuscle.data.drawn_bones import DrawnBone, DrawnBones
from vtkmuscle.plotting.actors import bone_actor
from vtkmuscle.plotting.views import View, axes_of

#: Pixels that are rendered for one of a picture, along each side.
FINER = 2
#: The five lights of vtkLightKit: where each comes from, (right, up, towards the eye), and its colour.
_LIGHTS = (
    ((0.0, 0.0, 1.0), (0.25, 0.25, 0.25)),
    ((0.111619, 0.766044, 0.633022), (0.75, 0.72924, 0.676665)),
    ((-0.044943, -0.965926, 0.254887), (0.22706, 0.233285, 0.25)),
    ((0.939693, 0.0, -0.34202), (0.214286, 0.214286, 0.214286)),
    ((-0.939693, 0.0, -0.34202), (0.214286, 0.214286, 0.214286)),
)
#: Diffuse lighting of a fragment by them, at half the cost of VTK's own shader where OpenGL is in software.
_LIT = "\n".join(
    [
        "vec3 lit = vec3(0.0);",
        *(
            f"lit += max(dot(normalVCVSOutput, vec3{towards}), 0.0) * vec3{colour};"
            for towards, colour in _LIGHTS
        ),
        "gl_FragData[0] = vec4(ambientColor + lit * diffuseColor, opacity);",
    ]
)


class Studio:
    """A window off the screen in which pictures are taken one after the other, bones made for it once.

    It belongs to the thread that has made it; use it as a context, or close it.

    Parameters
    ----------
    detail : float, optional
        Pixels of a picture for one of its view, along each side.

    Attributes
    ----------
    finer : float
        Pixels that are rendered for one of a view, along each side.
    pictures, triangles : int
        How many pictures were taken, and how many triangles were drawn for them.
    """

    def __init__(self, detail: float = 1.0) -> None:
        self._detail, self.finer = detail, FINER * detail
        with x_server_warning_off():
            self._window, self._renderer = vtkRenderWindow(), vtkRenderer()
            self._window.SetOffScreenRendering(True)
        self._window.SetMultiSamples(0)  # in software they cost more than finer pixels
        self._window.AddRenderer(self._renderer)
        self._renderer.SetBackground(1.0, 1.0, 1.0)
        # Muscles hide no back faces and are all of one colour: their order makes no difference that is seen.
        self._renderer.SetUseOIT(False)
        self._bones: dict[DrawnBone, vtkActor] = {}
        self.pictures = self.triangles = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give back what the window holds."""
        self._window.Finalize()

    def picture(
        self,
        actors: Sequence[vtkActor],
        view: View,
        *,
        bones: DrawnBones | None = None,
        transforms: Mapping[str, Floats] | None = None,
    ) -> NDArray[np.uint8]:
        """Return a picture (height, width, 3) of some actors and bones on white, in the studio's detail.

        Parameters
        ----------
        actors : sequence of vtkActor
            See :mod:`vtkmuscle.plotting.actors`.
        view : View
            From where; it has the size of the picture.
        bones : DrawnBones, optional
            Drawn as well.
        transforms : mapping of str to (4, 4) array, optional
            From rest to where they are, of bones that have moved.
        """
        # What is in front comes first: pixels that are hidden need not be lit.
        shown = [*actors, *self._moved(bones, transforms or {})]
        for actor in shown:
            self._renderer.AddActor(actor)
            shader = actor.GetShaderProperty()
            if not shader.GetNumberOfShaderReplacements():
                shader.AddFragmentShaderReplacement("//VTK::Light::Impl", True, _LIT, False)
        width, height = (round(self._detail * side) for side in view.size)
        self._window.SetSize(FINER * width, FINER * height)
        look_from(self._renderer.GetActiveCamera(), view)
        self._renderer.ResetCameraClippingRange()
        self._window.Render()
        pixels = vtkUnsignedCharArray()
        self._window.GetRGBACharPixelData(0, 0, FINER * width - 1, FINER * height - 1, 0, pixels, 0)
        fine = Image.frombuffer("RGBX", (FINER * width, FINER * height), vtk_to_numpy(pixels))
        for actor in shown:
            self._renderer.RemoveActor(actor)
        for actor in actors:
            actor.ReleaseGraphicsResources(self._window)
        self.pictures += 1
        self.triangles += sum(actor.GetMapper().GetInput().GetNumberOfPolys() for actor in shown)
        image: NDArray[np.uint8] = np.asarray(fine.reduce(FINER))[::-1, :, :3]
        return image

    def _moved(self, bones: DrawnBones | None, transforms: Mapping[str, Floats]) -> Iterator[vtkActor]:
        for name, bone in {} if bones is None else bones.by_name.items():
            actor = self._bones.get(bone) or self._bones.setdefault(bone, bone_actor(bone))
            actor.SetUserMatrix(matrix_of(transforms.get(name)))
            yield actor


def matrix_of(transform: Floats | None) -> vtkMatrix4x4:
    """Return a (4, 4) transform as VTK has it, the identity for None."""
    matrix = vtkMatrix4x4()
    if transform is not None:
        matrix.DeepCopy(np.asarray(transform).ravel().tolist())
    return matrix


def look_from(camera: vtkCamera, view: View) -> None:
    """Let a camera look as a view says, in parallel projection."""
    camera.SetParallelProjection(True)
    camera.SetFocalPoint(*view.focus)
    camera.SetPosition(*(view.focus + 10.0 * view.half_height * view.direction))
    camera.SetViewUp(*axes_of(view.direction)[1])
    camera.SetParallelScale(view.half_height)


@contextmanager
def x_server_warning_off() -> Iterator[None]:
    """Keep quiet VTK's warning that there is no X server, which a picture off-screen does not need."""
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)
