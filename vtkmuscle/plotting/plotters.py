"""PyVista plotters of bones, muscles and fibres."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from vtkmodules.vtkCommonDataModel import vtkMultiBlockDataSet, vtkPolyData

from vtkmuscle.core.types import Floats
from vtkmuscle.data.arrays import blocks_of, multiblock_from
from vtkmuscle.filters.base.filter import Filter
from vtkmuscle.plotting import studio
from vtkmuscle.plotting.views import PALETTE, View, choose_view, fibre_surface, merged

if TYPE_CHECKING:
    import pyvista


def plain_plotter(size: Sequence[int] | None, off_screen: bool | None) -> "pyvista.Plotter":
    """Return a white plotter in the user's notebook backend."""
    import pyvista  # noqa: PLC0415 -- figures need none

    theme, own = pyvista.themes.DocumentTheme(), pyvista.global_theme
    if own.jupyter_backend != theme.jupyter_backend:  # PyVista checks a backend when set
        theme.jupyter_backend = own.jupyter_backend
    theme.trame = own.trame
    with studio.x_server_warning_off():
        plotter = pyvista.Plotter(off_screen=off_screen, window_size=size and list(size), theme=theme)
    plotter.enable_anti_aliasing("ssaa")
    return plotter


def make_plotter(
    bones: vtkMultiBlockDataSet, muscles: Sequence[vtkPolyData], view: View, *,
    fibres: vtkPolyData | None = None, colours: NDArray[np.uint8] | None = None, fixed_points: bool = False,
    off_screen: bool | None = True,
) -> "pyvista.Plotter":  # fmt: skip
    """Return a plotter of bones, translucent muscles and fibres, to be closed after use.

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
    colours : (n_fibres, 3) array of uint8, optional
        Fibre colours, as of :func:`strain_colours`.
    fixed_points : bool, optional
        Mark fixed points (point array ``FixedTo``) by spheres, coloured by bone.
    off_screen : bool or None, optional
        None for a window on :meth:`pyvista.Plotter.show`, unless PyVista draws off-screen.
    """
    plotter = plain_plotter(view.size, off_screen)
    # PyVista's anti-aliasing renders 4 x 4 pixels.
    looks: dict[str, Any] = {"colours": colours, "fixed_points": fixed_points, "finer": 4}
    actors = studio.actors_of(muscles, view, fibres=fibres, **looks)
    for actor in (*(studio.surface_actor(bone) for _, bone in blocks_of(bones)), *actors):
        plotter.add_actor(actor, reset_camera=False, render=False)
    studio.look_from(plotter.camera, view)
    plotter.renderer.ResetCameraClippingRange()
    return plotter


class MovingScene:
    """Bones, translucent muscles and fibres at rest on a ``plotter``, moved by :meth:`show`.

    ``view`` is that of the muscles, or else fibres or bones, with the least hidden area; ``opacity`` is of
    muscles without fibres.
    """

    def __init__(
        self, bones: Mapping[str, vtkPolyData] | vtkMultiBlockDataSet, muscles: Mapping[str, vtkPolyData],
        fibres: Mapping[str, vtkPolyData], *, off_screen: bool | None = None,
        size: Sequence[int] | None = None, opacity: float = 0.9,
    ) -> None:  # fmt: skip
        named = dict(blocks_of(bones)) if isinstance(bones, vtkMultiBlockDataSet) else bones
        seen = [*muscles.values()] or [*map(fibre_surface, fibres.values())] or [*named.values()]
        self.view = choose_view([merged(seen)], [multiblock_from(dict(named))])
        self.plotter = plain_plotter(size, off_screen)
        colours = {name: PALETTE[i % len(PALETTE)] for i, name in enumerate(muscles or fibres)}
        self._bones = {name: studio.surface_actor(surface) for name, surface in named.items()}
        self._muscles = {}
        for name, surface in muscles.items():
            dense = 0.55 if name in fibres else opacity
            self._muscles[name] = studio.surface_actor(surface, colours[name], opacity=dense)
        self._fibres = {name: studio.line_actor(lines, colours[name]) for name, lines in fibres.items()}
        for actor in chain(self._bones.values(), self._muscles.values(), self._fibres.values()):
            self.plotter.add_actor(actor, reset_camera=False, render=False)
        width, height = self.plotter.window_size
        studio.look_from(self.plotter.camera, self.view)
        self.plotter.camera.parallel_scale *= 1.2 * max(1.0, self.view.aspect * height / width)
        self.plotter.renderer.ResetCameraClippingRange()

    def show(
        self, bones: Mapping[str, Floats], muscles: Mapping[str, Floats], fibres: Mapping[str, Floats]
    ) -> None:
        """Move all actors, for the next rendering.

        ``bones`` are rigid transforms (4, 4) from rest by bone; ``muscles`` and ``fibres`` points (n, 3) by
        muscle. Missing bones stay at rest, missing muscles are hidden.
        """
        for name, actor in self._bones.items():
            actor.SetUserMatrix(studio.matrix_of(bones.get(name)))
        for actors, positions in ((self._muscles, muscles), (self._fibres, fibres)):
            for name, actor in actors.items():
                actor.SetVisibility(name in positions)
                if name in positions:
                    studio.move_points(actor, positions[name])
        self.plotter.renderer.ResetCameraClippingRange()


def show_time(plotter: "pyvista.Plotter", time: float) -> None:
    """Render all filters on a plotter at a time.

    Parameters
    ----------
    plotter : pyvista.Plotter
        With algorithms; data sets stay unchanged.
    time : float
        Pipeline time.
    """
    for renderer in plotter.renderers:
        # PyVista's renderer.actors uses reusable addresses as names, and can lack actors.
        for actor in renderer.GetViewProps():
            mapper = actor.GetMapper() if hasattr(actor, "GetMapper") else None
            if mapper is None or not mapper.GetNumberOfInputConnections(0):
                continue
            last = mapper.GetInputAlgorithm(0, 0)
            # VTK's update cannot raise; a filter's update can.
            for algorithm in _filters_behind(last):
                algorithm.update(time=time)
            last.UpdateTimeStep(float(time))
    plotter.render()


def _filters_behind(algorithm: Any) -> Iterator[Filter]:
    """Yield the nearest filters of the package upstream."""
    if isinstance(algorithm, Filter):
        yield algorithm
        return
    for port in range(algorithm.GetNumberOfInputPorts()):
        for index in range(algorithm.GetNumberOfInputConnections(port)):
            yield from _filters_behind(algorithm.GetInputAlgorithm(port, index))
