"""Filters on a plotter at a pipeline time: animations and time sliders."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from vtkmuscle.filters.base.filter import Filter

if TYPE_CHECKING:
    import pyvista


def show_time(plotter: pyvista.Plotter, time: float) -> None:
    """Bring all that a plotter shows to a pipeline time, and render it.

    Data sets stay as they are; filters that were given to ``plotter.add_mesh``, and VTK's filters behind
    them, are asked for their output at that time.

    Parameters
    ----------
    plotter : pyvista.Plotter
        With algorithms on it.
    time : float
        Pipeline time.

    Raises
    ------
    Exception
        Whatever a filter raised.
    """
    for renderer in plotter.renderers:
        # Not renderer.actors: its keys are names made of the addresses of data sets that may be gone, so that
        # of two actors with one name it has the last one alone.
        for actor in renderer.GetViewProps():
            mapper = actor.GetMapper() if hasattr(actor, "GetMapper") else None
            if mapper is None or not mapper.GetNumberOfInputConnections(0):
                continue
            last = mapper.GetInputAlgorithm(0, 0)
            # VTK's own update cannot raise; a filter's can.
            for algorithm in _filters_behind(last):
                algorithm.update(time=time)
            last.UpdateTimeStep(float(time))
    plotter.render()


def add_time_slider(plotter: pyvista.Plotter, times: Sequence[float], **appearance: Any) -> Any:
    """Add a slider that moves all filters on a plotter through time.

    Parameters
    ----------
    plotter : pyvista.Plotter
        With algorithms on it.
    times : sequence of float
        From the first to the last of them the slider goes; it may stop between two.
    **appearance
        Of :meth:`pyvista.Plotter.add_slider_widget`: ``title``, ``pointa``, ``pointb``, ``value`` and so on.

    Returns
    -------
    vtkSliderWidget
        The slider.
    """
    return plotter.add_slider_widget(
        lambda time: show_time(plotter, time), (float(min(times)), float(max(times))), **appearance
    )


def _filters_behind(algorithm: Any) -> list[Filter]:
    """Return the nearest of our filters upstream of an algorithm, or itself."""
    if isinstance(algorithm, Filter):
        return [algorithm]
    return [
        found
        for port in range(algorithm.GetNumberOfInputPorts())
        for index in range(algorithm.GetNumberOfInputConnections(port))
        for found in _filters_behind(algorithm.GetInputAlgorithm(port, index))
    ]
