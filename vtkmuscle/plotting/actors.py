"""Bones, muscles, fibres and fixed points as VTK actors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonComputationalGeometry import vtkCardinalSpline
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersGeneral import vtkSplineFilter
from vtkmodules.vtkRenderingCore import VTK_PHONG, vtkActor, vtkPolyDataMapper, vtkProperty

from vtkmuscle.core.mesh.normals import vertex_normals
from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import (
    point_array,
    points_of,
    polylines_from,
    polylines_of,
    set_cell_array,
    surface_from,
    triangles_of,
    vtk_points,
)
from vtkmuscle.data.drawn_bones import DrawnBone
from vtkmuscle.plotting.colours import FIBRE_MAP, IVORY, MUSCLE_RED, NEUTRAL, PALETTE, PLACE_MAP
from vtkmuscle.plotting.views import View

_PLAIN_FIBRES = "#f3d9c9"
_COLOURS = "Colours"


def actors_of(
    muscles: Sequence[vtkPolyData],
    view: View,
    *,
    fibres: vtkPolyData | None = None,
    colours: NDArray[np.uint8] | None = None,
    fixed_points: bool = False,
    finer: float = 1.0,
) -> list[vtkActor]:
    """Return muscles, fibres and fixed points, as in :func:`~vtkmuscle.plotting.make_plotter`.

    A muscle with fibres shows its far wall only, in grey, without tinting the fibres' colours. ``finer`` is
    the number of rendered pixels per picture pixel, along each side.
    """
    actors = []
    if fibres is not None and fibres.GetNumberOfLines():
        actors.append(fibre_actor(fibres, finer * view.size[1] / 160.0, colours))
    for muscle in muscles:
        if fixed_points:
            actors += fixed_point_actors(muscle, finer * view.size[1] / 110.0)
        colour = MUSCLE_RED if fibres is None else NEUTRAL
        actor = surface_actor(muscle, colour, opacity=0.35 if fixed_points else 0.5)
        if fibres is not None:
            actor.GetProperty().SetBackfaceCulling(False)
            actor.GetProperty().SetFrontfaceCulling(True)
        actors.append(actor)
    return actors


def bone_actor(bone: DrawnBone) -> vtkActor:
    """Return a bone at rest in ivory.

    Closed bones hide back faces.
    """
    surface = _with_normals(surface_from(bone.points, bone.triangles), bone.normals)
    return _actor(surface, IVORY, backface_culling=bone.solid)


def surface_actor(surface: vtkPolyData, colour: str = IVORY, *, opacity: float = 1.0) -> vtkActor:
    """Return a surface of triangles, translucent for an opacity below 1."""
    points, triangles = points_of(surface), triangles_of(surface, "plotting")
    own = _with_normals(surface_from(points, triangles), vertex_normals(points, triangles))
    # Back faces of a translucent surface would be blended in arbitrary order.
    return _actor(own, colour, opacity=opacity, backface_culling=opacity < 1.0)


def move_points(actor: vtkActor, points: Floats) -> None:
    """Move the points of a surface or of lines."""
    data = actor.GetMapper().GetInput()
    data.SetPoints(vtk_points(points))
    if data.GetNumberOfPolys():
        _with_normals(data, vertex_normals(points, triangles_of(data, "plotting")))


def fixed_point_actors(muscle: vtkPolyData, diameter: float) -> list[vtkActor]:
    """Return fixed points as balls [pixels], coloured by bone."""
    points, fixed_to = points_of(muscle), fixed_bones(muscle)
    actors = []
    for bone in np.unique(fixed_to[fixed_to >= 0]):
        fixed = points[fixed_to == bone]
        vertices = vtkCellArray()
        vertices.SetData(1, numpy_to_vtk(np.arange(len(fixed)), deep=True))
        balls = vtkPolyData(points=vtk_points(fixed), verts=vertices)
        colour = PALETTE[bone % len(PALETTE)]
        look = {"ambient": 0.3, "render_points_as_spheres": True, "point_size": diameter}
        actors.append(_actor(balls, colour, **look))
    return actors


def line_actor(lines: vtkPolyData, colour: str) -> vtkActor:
    """Return polylines in a pale tint, 2.5 pixels wide."""
    look = {"line_width": 2.5, "render_lines_as_tubes": True, "ambient": 0.0, "specular": 0.0}
    actor = _actor(polylines_from(polylines_of(lines, "plotting: fibres")), colour, **look)
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
    return _colours(FIBRE_MAP, 0.5 + 0.5 * strain / limit)


def position_colours(positions: Floats) -> NDArray[np.uint8]:
    """Return colours (n, 3) of positions (n,) from 0 to 1."""
    return _colours(PLACE_MAP, positions)


def fibre_actor(fibres: vtkPolyData, width: float, colours: NDArray[np.uint8] | None = None) -> vtkActor:
    """Return splines through fibre points, shaded as tubes.

    ``width`` is in pixels.

    ``colours`` are (n_fibres, 3). Rendering tubes of triangles takes a third longer.
    """
    lines = polylines_from(polylines_of(fibres, "plotting: fibres"))
    if colours is not None:
        set_cell_array(lines, _COLOURS, colours)
    # The end curvature equals the neighbouring point's, so that arcs stay round.
    cubic = vtkCardinalSpline(left_constraint=3, right_constraint=3, left_value=1.0, right_value=1.0)
    # Thick lines have gaps at bends; with this many pieces, gaps are invisible.
    pieces = max(24, round(5.0 * width))
    splines = vtkSplineFilter(spline=cubic, input_data=lines, number_of_subdivisions=pieces)
    splines.SetSubdivideToSpecified()
    splines.Update()
    look = {"line_width": width, "render_lines_as_tubes": True, "ambient": 0.25}
    actor = _actor(splines.GetOutput(), _PLAIN_FIBRES, **look)
    if colours is not None:
        mapper = actor.GetMapper()
        mapper.SetScalarVisibility(True)
        mapper.SetScalarModeToUseCellFieldData()
        mapper.SelectColorArray(_COLOURS)
        mapper.SetColorModeToDirectScalars()
    return actor


def fixed_bones(muscle: vtkPolyData) -> Ints:
    """Return the bone index of points, -1 for free points.

    The point array ``FixedTo`` has the indices.
    """
    if muscle.GetPointData().GetArray("FixedTo") is None:
        return np.full(muscle.GetNumberOfPoints(), -1)
    return point_array(muscle, "FixedTo", "plotting: muscle").astype(np.int64)


def _colours(name: str, part: Floats) -> NDArray[np.uint8]:
    colours: NDArray[np.uint8] = colormaps[name](part, bytes=True)[:, :3]
    return colours


def _with_normals(surface: vtkPolyData, normals: Floats) -> vtkPolyData:
    surface.GetPointData().SetNormals(numpy_to_vtk(normals.astype(np.float32), deep=True))
    return surface


def _actor(data: vtkPolyData, colour: str, **look: Any) -> vtkActor:
    """Return data in a colour; ``look`` are properties of a vtkProperty."""
    shine = {"ambient": 0.15, "specular": 0.1, "specular_power": 100.0, "interpolation": VTK_PHONG}
    return vtkActor(
        mapper=vtkPolyDataMapper(input_data=data, scalar_visibility=False),
        property=vtkProperty(color=to_rgb(colour), **{**shine, **look}),
    )
