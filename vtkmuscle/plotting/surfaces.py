"""Bones, muscles and fibres on a PyVista plotter."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
import pyvista
from vtkmodules.vtkCommonCore import vtkLogger
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.types import Floats, Ints
from vtkmuscle.data.arrays import blocks_of, point_array, points_of, polylines_from, polylines_of
from vtkmuscle.plotting.views import View, axes_of

IVORY = "#efe6d0"
MUSCLE_RED = "#8b1a1a"
FIBRE_MAP = "coolwarm"
#: Colours of Okabe and Ito, which colour-blind readers can tell apart; bones and muscles take them in turn.
PALETTE = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#f0e442")


def make_plotter(
    bones: vtkMultiBlockDataSet,
    muscles: Sequence[vtkPolyData],
    view: View,
    *,
    fibres: vtkPolyData | None = None,
    strain: Floats | None = None,
    strain_limit: float = 10.0,
    fixed_points: bool = False,
    show_muscles: bool = True,
    off_screen: bool | None = True,
) -> pyvista.Plotter:
    """Return a plotter with ivory bones, translucent red muscles and fibres as tubes.

    Parameters
    ----------
    bones : vtkMultiBlockDataSet
        Named blocks of triangles.
    muscles : sequence of vtkPolyData
        Closed surfaces, oriented outward.
    view : View
        See :func:`choose_view`.
    fibres : vtkPolyData, optional
        Polylines.
    strain : (n_fibres,) array, optional
        Change of length [%], shown in colour; plain fibres where it is not given.
    strain_limit : float, optional
        The strain that gets the full colour, in either direction [%].
    fixed_points : bool, optional
        Mark the muscles' fixed points (point array ``FixedTo``) by spheres in the colour of their bone.
    show_muscles : bool, optional
        False for fibres or fixed points alone.
    off_screen : bool or None, optional
        None for a window that :meth:`pyvista.Plotter.show` opens, unless PyVista is set to draw off-screen.

    Returns
    -------
    pyvista.Plotter
        To be shown, or captured by ``screenshot``; close it afterwards.
    """
    with x_server_warning_off():
        plotter = pyvista.Plotter(
            off_screen=off_screen, window_size=view.size, theme=pyvista.themes.DocumentTheme()
        )
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    for _, bone in blocks_of(bones):
        _add_surface(plotter, bone, IVORY, opacity=1.0)
    for muscle in muscles:
        if show_muscles:
            opacity = 0.35 if fixed_points or fibres is not None else 0.5
            _add_surface(plotter, muscle, MUSCLE_RED, opacity=opacity)
        if fixed_points:
            _add_fixed_points(plotter, muscle, view)
    if fibres is not None and fibres.GetNumberOfLines():
        _add_fibres(plotter, fibres, view, strain, strain_limit)
    _look(plotter, view)
    return plotter


def _add_surface(plotter: pyvista.Plotter, surface: vtkPolyData, colour: str, *, opacity: float) -> None:
    # Normals under another name would be taken for those that are computed.
    shape = pyvista.wrap(surface).copy(deep=False)
    shape.clear_data()
    normals = shape.compute_normals(
        cell_normals=False, split_vertices=False, consistent_normals=False, auto_orient_normals=False
    )
    plotter.add_mesh(
        normals,
        color=colour,
        opacity=opacity,
        # Back faces of a translucent surface would be blended in no particular order.
        culling="back" if opacity < 1.0 else False,
        smooth_shading=True,
        split_sharp_edges=False,
        show_scalar_bar=False,
        scalars=None,
        ambient=0.15,
        specular=0.1,
    )


def _add_fixed_points(plotter: pyvista.Plotter, muscle: vtkPolyData, view: View) -> None:
    points, fixed_to = points_of(muscle), fixed_bones(muscle)
    for bone in np.unique(fixed_to[fixed_to >= 0]):
        spheres = pyvista.PolyData(points[fixed_to == bone]).glyph(
            geom=pyvista.Sphere(radius=view.half_height / 110.0, theta_resolution=10, phi_resolution=10),
            scale=False,
            orient=False,
        )
        plotter.add_mesh(spheres, color=PALETTE[bone % len(PALETTE)], smooth_shading=True, ambient=0.3)


def _add_fibres(
    plotter: pyvista.Plotter, fibres: vtkPolyData, view: View, strain: Floats | None, limit: float
) -> None:
    lines = pyvista.wrap(polylines_from(polylines_of(fibres, "plotting: fibres")))
    if strain is not None:
        lines.cell_data["strain"] = strain
    tubes = lines.tube(radius=view.half_height / 160.0, n_sides=10, capping=True)
    colour: dict[str, Any] = {"color": "#f3d9c9"}
    if strain is not None:
        colour = {"scalars": "strain", "cmap": FIBRE_MAP, "clim": (-limit, limit)}
    plotter.add_mesh(tubes, **colour, show_scalar_bar=False, smooth_shading=True, ambient=0.25)


def _look(plotter: pyvista.Plotter, view: View) -> None:
    camera = plotter.camera
    camera.parallel_projection = True
    camera.focal_point = tuple(view.focus)
    camera.position = tuple(view.focus + 10.0 * view.half_height * view.direction)
    camera.up = tuple(axes_of(view.direction)[1])
    camera.parallel_scale = view.half_height
    plotter.renderer.ResetCameraClippingRange()


@contextmanager
def x_server_warning_off() -> Iterator[None]:
    """Keep quiet VTK's warning that there is no X server, which a picture off-screen does not need."""
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)


def fixed_bones(muscle: vtkPolyData) -> Ints:
    """Return for each point the index of the bone that it is fixed to, -1 where it is free.

    Without the point array ``FixedTo`` all points are free.
    """
    if muscle.GetPointData().GetArray("FixedTo") is None:
        return np.full(muscle.GetNumberOfPoints(), -1)
    return point_array(muscle, "FixedTo", "plotting: muscle").astype(np.int64)
