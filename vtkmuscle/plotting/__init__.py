"""Off-screen pictures of a run: muscles, fibres and bones, fibre lengths and moment arms over time.

Surfaces are rendered in parallel projection on white, by VTK into figures and by PyVista where they are to be
moved; panels, titles, legends and curves are set with matplotlib's objects, so that no library's global state
is touched. Nothing here opens
a window unless asked to.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from vtkmuscle.plotting.export import export_scene
    from vtkmuscle.plotting.figures import plot_lengths, plot_muscle, plot_rest_pose
    from vtkmuscle.plotting.moment_arms import plot_moment_arms
    from vtkmuscle.plotting.movie import check_movie, write_movie
    from vtkmuscle.plotting.moving import MovingScene, Pose
    from vtkmuscle.plotting.preflight import can_render
    from vtkmuscle.plotting.studio import Studio
    from vtkmuscle.plotting.surfaces import make_plotter
    from vtkmuscle.plotting.times import add_time_slider, show_time
    from vtkmuscle.plotting.views import View, choose_view, framed

#: Module of each name: none is loaded before it is asked for, so that a run loads no matplotlib.
_SOURCES = {
    "MovingScene": "moving",
    "Pose": "moving",
    "Studio": "studio",
    "View": "views",
    "add_time_slider": "times",
    "can_render": "preflight",
    "check_movie": "movie",
    "choose_view": "views",
    "export_scene": "export",
    "framed": "views",
    "make_plotter": "surfaces",
    "plot_lengths": "figures",
    "plot_moment_arms": "moment_arms",
    "plot_muscle": "figures",
    "plot_rest_pose": "figures",
    "show_time": "times",
    "write_movie": "movie",
}

__all__ = [
    "MovingScene",
    "Pose",
    "Studio",
    "View",
    "add_time_slider",
    "can_render",
    "check_movie",
    "choose_view",
    "export_scene",
    "framed",
    "make_plotter",
    "plot_lengths",
    "plot_moment_arms",
    "plot_muscle",
    "plot_rest_pose",
    "show_time",
    "write_movie",
]


def __getattr__(name: str) -> Any:
    if name in _SOURCES:
        return getattr(import_module(f"{__name__}.{_SOURCES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
