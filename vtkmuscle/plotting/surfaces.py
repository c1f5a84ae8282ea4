"""Bones, muscles and fibres on a PyVista plotter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import blocks_of
from vtkmuscle.plotting.actors import actors_of, strain_colours, surface_actor
from vtkmuscle.plotting.studio import look_from, x_server_warning_off
from vtkmuscle.plotting.views import View

if TYPE_CHECKING:
    import pyvista

#: Pixels that PyVista's smoothing of edges renders for one of a picture, along each side.
_FINER = 4


def plain_plotter(size: tuple[int, int], off_screen: bool | None) -> pyvista.Plotter:
    """Return a white plotter whatever the user's theme, in the user's backend for notebooks."""
    import pyvista  # noqa: PLC0415 -- figures need none

    theme, own = pyvista.themes.DocumentTheme(), pyvista.global_theme
    if own.jupyter_backend != theme.jupyter_backend:  # PyVista checks a backend where it is set, not before
        theme.jupyter_backend = own.jupyter_backend
    theme.trame = own.trame
    with x_server_warning_off():
        plotter = pyvista.Plotter(off_screen=off_screen, window_size=list(size), theme=theme)
    plotter.set_background("white")
    plotter.enable_anti_aliasing("ssaa")
    return plotter


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
    """Return a plotter with ivory bones, translucent muscles and fibres as tubes before them.

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
    plotter = plain_plotter(view.size, off_screen)
    actors = actors_of(
        muscles,
        view,
        fibres=fibres,
        colours=None if strain is None else strain_colours(strain, strain_limit),
        fixed_points=fixed_points,
        show_muscles=show_muscles,
        finer=_FINER,
    )
    for actor in (*(surface_actor(bone) for _, bone in blocks_of(bones)), *actors):
        plotter.add_actor(actor, reset_camera=False, render=False)
    look_from(plotter.camera, view)
    plotter.renderer.ResetCameraClippingRange()
    return plotter
