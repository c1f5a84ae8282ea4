"""Bones, muscles, fibres and fixed points as VTK draws them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonComputationalGeometry import vtkCardinalSpline
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTubeFilter
from vtkmodules.vtkFiltersGeneral import vtkSplineFilter
from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

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
#: Sides of a fibre's tube.
_SIDES = 8
#: Straight pieces that a drawn fibre has: its points are joined by a cubic spline.
_PIECES = 48
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
    """Return muscles, fibres and fixed points, as of :func:`~vtkmuscle.plotting.make_plotter`.

    Only the far wall of a muscle with fibres is drawn, in grey, so that it does not tint their colours.
    ``finer`` is the number of pixels rendered for one of the picture, along each side.
    """
    actors = []
    if fibres is not None and fibres.GetNumberOfLines():
        actors.append(fibre_actor(fibres, view.half_height / 160.0, colours))
    for muscle in muscles:
        if fixed_points:
            actors += fixed_point_actors(muscle, finer * view.size[1] / 110.0)
        actors.append(_muscle_actor(muscle, fibres is not None, 0.35 if fixed_points else 0.5))
    return actors


def bone_actor(bone: DrawnBone) -> vtkActor:
    """Return a bone at rest, ivory; of one that is solid no triangle is drawn from behind."""
    actor = _actor(_with_normals(bone.points, bone.triangles, bone.normals), IVORY)
    actor.GetProperty().SetBackfaceCulling(bone.solid)
    return actor


def surface_actor(surface: vtkPolyData, colour: str = IVORY, *, opacity: float = 1.0) -> vtkActor:
    """Return a surface of triangles with a part of the light going through it."""
    points, triangles = points_of(surface), triangles_of(surface, "plotting")
    actor = _actor(_with_normals(points, triangles, vertex_normals(points, triangles)), colour)
    actor.GetProperty().SetOpacity(opacity)
    # Back faces of a translucent surface would be blended in no particular order.
    actor.GetProperty().SetBackfaceCulling(opacity < 1.0)
    return actor


def fixed_point_actors(muscle: vtkPolyData, diameter: float) -> list[vtkActor]:
    """Return the fixed points of a muscle as balls [pixels], for each bone in its colour."""
    points, fixed_to = points_of(muscle), fixed_bones(muscle)
    actors = []
    for bone in np.unique(fixed_to[fixed_to >= 0]):
        held = points[fixed_to == bone]
        balls = vtkPolyData()
        balls.SetPoints(vtk_points(held))
        vertices = vtkCellArray()
        vertices.SetData(1, numpy_to_vtk(np.arange(len(held)), deep=True))
        balls.SetVerts(vertices)
        actor = _actor(balls, PALETTE[bone % len(PALETTE)], ambient=0.3)
        actor.GetProperty().SetRenderPointsAsSpheres(True)
        actor.GetProperty().SetPointSize(diameter)
        actors.append(actor)
    return actors


def strain_colours(strain: Floats, limit: float) -> NDArray[np.uint8]:
    """Return the colours (n, 3) of strains (n,) [%], full at a limit in either direction.

    Examples
    --------
    >>> import numpy as np
    >>> from vtkmuscle.plotting import strain_colours
    >>> strain_colours(np.array([-10.0, 10.0]), limit=10.0).tolist()
    [[58, 76, 192], [179, 3, 38]]
    """
    return _colours(FIBRE_MAP, 0.5 + 0.5 * strain / limit)


def place_colours(places: Floats) -> NDArray[np.uint8]:
    """Return the colours (n, 3) of places (n,) across a muscle, 0 to 1."""
    return _colours(PLACE_MAP, places)


def fibre_actor(fibres: vtkPolyData, radius: float, colours: NDArray[np.uint8] | None = None) -> vtkActor:
    """Return fibres as tubes round the splines through their points, in colours (n_fibres, 3) if given."""
    lines = polylines_from(polylines_of(fibres, "plotting: fibres"))
    if colours is not None:
        set_cell_array(lines, _COLOURS, colours)
    cubic = vtkCardinalSpline()  # bent at its ends as at the points beside them, which keeps arcs round
    cubic.SetLeftConstraint(3)
    cubic.SetRightConstraint(3)
    cubic.SetLeftValue(1.0)
    cubic.SetRightValue(1.0)
    splines = vtkSplineFilter()
    splines.SetSpline(cubic)
    splines.SetInputData(lines)
    splines.SetSubdivideToSpecified()
    splines.SetNumberOfSubdivisions(_PIECES)
    tubes = vtkTubeFilter()
    tubes.SetInputConnection(splines.GetOutputPort())
    tubes.SetRadius(radius)
    tubes.SetNumberOfSides(_SIDES)
    tubes.CappingOn()
    tubes.Update()
    actor = _actor(tubes.GetOutput(), _PLAIN_FIBRES, ambient=0.25)
    actor.GetProperty().SetBackfaceCulling(True)  # nobody sees the inside of a tube
    if colours is not None:
        mapper = actor.GetMapper()
        mapper.SetScalarVisibility(True)
        mapper.SetScalarModeToUseCellFieldData()
        mapper.SelectColorArray(_COLOURS)
        mapper.SetColorModeToDirectScalars()
    return actor


def fixed_bones(muscle: vtkPolyData) -> Ints:
    """Return the index of the bone that each point is fixed to, -1 for a free one, from ``FixedTo``."""
    if muscle.GetPointData().GetArray("FixedTo") is None:
        return np.full(muscle.GetNumberOfPoints(), -1)
    return point_array(muscle, "FixedTo", "plotting: muscle").astype(np.int64)


def _muscle_actor(muscle: vtkPolyData, with_fibres: bool, opacity: float) -> vtkActor:
    """Return a muscle that light goes through, of one with fibres the wall behind them."""
    actor = surface_actor(muscle, NEUTRAL if with_fibres else MUSCLE_RED, opacity=opacity)
    actor.GetProperty().SetBackfaceCulling(not with_fibres)
    actor.GetProperty().SetFrontfaceCulling(with_fibres)
    return actor


def _colours(name: str, part: Floats) -> NDArray[np.uint8]:
    colours: NDArray[np.uint8] = colormaps[name](part, bytes=True)[:, :3]
    return colours


def _with_normals(points: Floats, triangles: Ints, normals: Floats) -> vtkPolyData:
    surface = surface_from(points, triangles)
    surface.GetPointData().SetNormals(numpy_to_vtk(normals.astype(np.float32), deep=True))
    return surface


def _actor(data: vtkPolyData, colour: str, *, ambient: float = 0.15) -> vtkActor:
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.SetScalarVisibility(False)
    actor = vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetColor(*to_rgb(colour))
    look.SetInterpolationToPhong()
    look.SetAmbient(ambient)
    look.SetSpecular(0.1)
    look.SetSpecularPower(100.0)
    return actor
