"""Bones, muscles, fibres and fixed points as VTK actors, and an off-screen window for pictures."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Self

import numpy as np
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 -- implements windows and mappers
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from PIL import Image
from vtkmodules import vtkRenderingCore
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonComputationalGeometry import vtkCardinalSpline
from vtkmodules.vtkCommonCore import vtkLogger, vtkUnsignedCharArray
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersGeneral import vtkSplineFilter, vtkVertexGlyphFilter
from vtkmodules.vtkRenderingCore import VTK_PHONG, vtkActor, vtkCamera, vtkRenderer, vtkRenderWindow

from vtkmuscle.core.mesh.normals import vertex_normals
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data import arrays, package_text
from vtkmuscle.io.in_child import log_level
from vtkmuscle.plotting import views

_PLAIN_FIBRES = "#f3d9c9"
#: Array of colours by line or point.
COLOURS = "Colours"


def actors_of(
    muscles: Sequence[vtkPolyData], view: views.View, *, fibres: vtkPolyData | None = None,
    colours: NDArray[np.uint8] | None = None, fixed_points: bool = False, finer: float = 1.0,
) -> list[vtkActor]:  # fmt: skip
    """Return muscles, fibres and fixed points, as in :func:`~vtkmuscle.plotting.make_plotter`."""
    actors = []
    if fibres is not None and fibres.GetNumberOfLines():
        actors.append(fibre_actor(fibres, finer * view.size[1] / 160.0, colours))
    for muscle in muscles:
        if fixed_points:
            actors += fixed_point_actors(muscle, finer * view.size[1] / 110.0)
        colour = views.MUSCLE_RED if fibres is None else views.NEUTRAL
        actor = surface_actor(muscle, colour, opacity=0.35 if fixed_points else 0.5)
        if fibres is not None:
            actor.GetProperty().SetBackfaceCulling(False)
            actor.GetProperty().SetFrontfaceCulling(True)
        actors.append(actor)
    return actors


def surface_actor(surface: vtkPolyData, colour: str = views.IVORY, *, opacity: float = 1.0) -> vtkActor:
    """Return a surface of triangles, translucent for an opacity below 1."""
    points, triangles = arrays.points_of(surface), arrays.triangles_of(surface, "plotting")
    own = _with_normals(arrays.surface_from(points, triangles), vertex_normals(points, triangles))
    # Back faces of a translucent surface would be blended in arbitrary order.
    return _actor(own, colour, opacity=opacity, backface_culling=opacity < 1.0)


def move_points(actor: vtkActor, points: Floats) -> None:
    """Move the points of a surface or of lines."""
    data = actor.GetMapper().GetInput()
    data.SetPoints(arrays.vtk_points(points))
    if data.GetNumberOfPolys():
        _with_normals(data, vertex_normals(points, arrays.triangles_of(data, "plotting")))


def fixed_point_actors(muscle: vtkPolyData, diameter: float) -> Iterator[vtkActor]:
    """Yield fixed points as balls [pixels], coloured by bone."""
    points, fixed_to = arrays.points_of(muscle), fixed_bones(muscle)
    for bone in np.unique(fixed_to[fixed_to >= 0]):
        fixed = vtkPolyData(points=arrays.vtk_points(points[fixed_to == bone]))
        balls = vtkVertexGlyphFilter(input_data=fixed).update().output
        colour = views.PALETTE[bone % len(views.PALETTE)]
        look = {"ambient": 0.3, "render_points_as_spheres": True, "point_size": diameter}
        yield _actor(balls, colour, **look)


def line_actor(lines: vtkPolyData, colour: str) -> vtkActor:
    """Return polylines in a pale tint, 2.5 pixels wide."""
    look = {"line_width": 2.5, "render_lines_as_tubes": True, "ambient": 0.0, "specular": 0.0}
    actor = _actor(arrays.polylines_from(arrays.polylines_of(lines, "plotting: fibres")), colour, **look)
    actor.GetProperty().SetColor(*(0.5 + 0.5 * part for part in to_rgb(colour)))
    return actor


def strain_colours(strain: Floats, limit: float) -> NDArray[np.uint8]:
    """Return colours (n, 3) of strains (n,) [%].

    Colours saturate at the limit.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.plotting import strain_colours
    >>> strain_colours(np.array([-10.0, 10.0]), limit=10.0).tolist()
    [[58, 76, 192], [179, 3, 38]]
    """
    return colours_of(0.5 + 0.5 * strain / limit, views.FIBRE_MAP)


def strains_of(rest: Floats, lengths: Sequence[Floats]) -> tuple[list[Floats], float]:
    """Return changes (k,) of lengths (k,) since rest [%], and the limit of their colours."""
    strains = [100.0 * (now / np.maximum(rest, 1e-12) - 1.0) for now in lengths]
    return strains, max(1.0, float(np.percentile(np.abs(strains), 98))) if strains else 1.0


def fibre_actor(fibres: vtkPolyData, width: float, colours: NDArray[np.uint8] | None = None) -> vtkActor:
    """Return splines through fibre points, shaded as tubes of a width [pixels]."""
    lines = arrays.polylines_from(arrays.polylines_of(fibres, "plotting: fibres"))
    if colours is not None:
        arrays.add_arrays(lines, cells={COLOURS: colours})
        lines.GetCellData().SetActiveScalars(COLOURS)
    # The end curvature equals the neighbouring point's, so that arcs stay round.
    cubic = vtkCardinalSpline(left_constraint=3, right_constraint=3, left_value=1.0, right_value=1.0)
    # Thick lines have gaps at bends; with this many pieces, gaps are invisible.
    pieces = max(24, round(5.0 * width))
    splines = vtkSplineFilter(spline=cubic, input_data=lines, number_of_subdivisions=pieces)
    # VTK shades tubes of more than a pixel alone.
    look = {"line_width": max(width, 1.1), "render_lines_as_tubes": True, "ambient": 0.25}
    actor = _actor(splines.update().output, _PLAIN_FIBRES, **look)
    actor.GetMapper().SetScalarVisibility(colours is not None)
    return actor


def fixed_bones(muscle: vtkPolyData) -> Ints:
    """Return the point array ``FixedTo``: bone indices, -1 for free points."""
    if muscle.GetPointData().GetArray("FixedTo") is None:
        return np.full(muscle.GetNumberOfPoints(), -1)
    return arrays.point_array(muscle, "FixedTo", "plotting: muscle").astype(np.int64)


def colours_of(values: Floats, name: str) -> NDArray[np.uint8]:
    """Return colours (n, 3) of values (n,) from 0 to 1 in a colour map."""
    return np.asarray(colormaps[name](values, bytes=True)[:, :3])


def _with_normals(surface: vtkPolyData, normals: Floats) -> vtkPolyData:
    surface.GetPointData().SetNormals(numpy_to_vtk(normals.astype(np.float32), deep=True))
    return surface


def _actor(data: vtkPolyData, colour: str, **look: Any) -> vtkActor:
    """Return data in a colour; ``look`` are properties of a vtkProperty."""
    shine = {"ambient": 0.15, "specular": 0.1, "specular_power": 100.0, "interpolation": VTK_PHONG}
    mapper = vtkRenderingCore.vtkPolyDataMapper(input_data=data, scalar_visibility=False)
    appearance = vtkRenderingCore.vtkProperty(color=to_rgb(colour), **{**shine, **look})
    return vtkActor(mapper=mapper, property=appearance)


#: Rendered pixels per pixel of a picture, along each side: their mean smooths edges.
FINER = 2
#: Diffuse lighting of a fragment, at half the cost of VTK's own shader with OpenGL in software.
_LIT = package_text("vtkmuscle.plotting", "lights.glsl")


class Studio:
    """An off-screen window for pictures, a context manager in a single thread.

    A picture has ``detail`` pixels per pixel of its view, along each side; ``finer`` pixels are rendered.
    """

    def __init__(self, detail: float = 1.0) -> None:
        self._detail, self.finer = detail, FINER * detail
        with x_server_warning_off():  # samples cost more in software than finer pixels
            self._window = vtkRenderWindow(off_screen_rendering=True, multi_samples=0)
        # Muscles of one colour without back faces look the same in any order.
        self._renderer = vtkRenderer(background=(1.0, 1.0, 1.0), use_oit=False)
        self._window.AddRenderer(self._renderer)
        self._bones: dict[views.DrawnBone, vtkActor] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._window.Finalize()

    def picture(
        self, actors: Sequence[vtkActor], view: views.View, *, bones: views.DrawnBones | None = None,
        transforms: Mapping[str, Floats] | None = None,
    ) -> NDArray[np.uint8]:  # fmt: skip
        """Return a picture (height, width, 3) of actors and of bones, moved from rest, on white."""
        # Actors in front come first: hidden pixels need no light.
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
        return np.asarray(fine.reduce(FINER))[::-1, :, :3]

    def _moved(self, bones: views.DrawnBones | None, transforms: Mapping[str, Floats]) -> Iterator[vtkActor]:
        for name, bone in {} if bones is None else bones.by_name.items():
            if (actor := self._bones.get(bone)) is None:
                surface = _with_normals(arrays.surface_from(bone.points, bone.triangles), bone.normals)
                actor = self._bones[bone] = _actor(surface, views.IVORY, backface_culling=bone.solid)
            actor.SetUserMatrix(matrix_of(transforms.get(name)))
            yield actor


def matrix_of(transform: Floats | None) -> vtkMatrix4x4:
    """Return a (4, 4) transform for VTK, the identity for None."""
    matrix = vtkMatrix4x4()
    if transform is not None:
        matrix.DeepCopy(np.asarray(transform).ravel().tolist())
    return matrix


def look_from(camera: vtkCamera, view: views.View) -> None:
    """Set a camera to a view, in parallel projection."""
    position, up = view.focus + 10.0 * view.half_height * view.direction, views.view_axes(view.direction)[1]
    arrays.with_settings(camera, ParallelProjection=True, FocalPoint=view.focus, Position=position, ViewUp=up)
    camera.SetParallelScale(view.half_height)


#: Context without VTK's warning of a missing X server, which off-screen pictures do not need.
x_server_warning_off = partial(log_level, vtkLogger.VERBOSITY_ERROR)
