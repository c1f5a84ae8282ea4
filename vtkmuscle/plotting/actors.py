"""Bones, muscles, fibres and fixed points as VTK draws them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkTubeFilter
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
from vtkmuscle.plotting.colours import FIBRE_MAP, IVORY, MUSCLE_RED, PALETTE
from vtkmuscle.plotting.views import View

_PLAIN_FIBRES = "#f3d9c9"
#: Sides of a fibre's tube.
_SIDES = 8
_COLOURS = "Colours"


def actors_of(
    muscles: Sequence[vtkPolyData],
    view: View,
    *,
    fibres: vtkPolyData | None = None,
    strain: Floats | None = None,
    strain_limit: float = 10.0,
    fixed_points: bool = False,
    show_muscles: bool = True,
    finer: int = 1,
) -> list[vtkActor]:
    """Return muscles, fibres and fixed points, as of :func:`~vtkmuscle.plotting.make_plotter`.

    Balls have the right size where ``finer`` pixels are rendered for one along each side of the picture.
    """
    actors = []
    if fibres is not None and fibres.GetNumberOfLines():
        actors.append(fibre_actor(fibres, view.half_height / 160.0, strain=strain, limit=strain_limit))
    for muscle in muscles:
        if fixed_points:
            actors += fixed_point_actors(muscle, finer * view.size[1] / 110.0)
        if show_muscles:
            opacity = 0.35 if fixed_points or fibres is not None else 0.5
            actors.append(surface_actor(muscle, MUSCLE_RED, opacity=opacity))
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


def fibre_actor(
    fibres: vtkPolyData, radius: float, *, strain: Floats | None = None, limit: float = 10.0
) -> vtkActor:
    """Return fibres as tubes, in the colour of their strain where it is given (n_fibres,) [%]."""
    lines = polylines_from(polylines_of(fibres, "plotting: fibres"))
    if strain is not None:
        set_cell_array(lines, _COLOURS, _colours(strain, limit))
    tubes = vtkTubeFilter()
    tubes.SetInputData(lines)
    tubes.SetRadius(radius)
    tubes.SetNumberOfSides(_SIDES)
    tubes.CappingOn()
    tubes.Update()
    actor = _actor(tubes.GetOutput(), _PLAIN_FIBRES, ambient=0.25)
    actor.GetProperty().SetBackfaceCulling(True)  # nobody sees the inside of a tube
    if strain is not None:
        mapper = actor.GetMapper()
        mapper.SetScalarVisibility(True)
        mapper.SetScalarModeToUseCellFieldData()
        mapper.SelectColorArray(_COLOURS)
        mapper.SetColorModeToDirectScalars()
    return actor


def fixed_bones(muscle: vtkPolyData) -> Ints:
    """Return for each point the index of the bone that it is fixed to, -1 where it is free.

    Without the point array ``FixedTo`` all points are free.
    """
    if muscle.GetPointData().GetArray("FixedTo") is None:
        return np.full(muscle.GetNumberOfPoints(), -1)
    return point_array(muscle, "FixedTo", "plotting: muscle").astype(np.int64)


def _colours(strain: Floats, limit: float) -> NDArray[np.uint8]:
    found: NDArray[np.uint8] = colormaps[FIBRE_MAP](0.5 + 0.5 * strain / limit, bytes=True)[:, :3]
    return found


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
