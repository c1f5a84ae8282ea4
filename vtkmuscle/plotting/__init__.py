"""Off-screen pictures of a run: muscles, fibres and bones, fibre lengths and volumes over time.

Surfaces are rendered in parallel projection on white, by VTK into figures and by PyVista where they are to be
moved; panels, titles, legends and curves are set with matplotlib's objects, so that no library's global state
is touched. Nothing here opens
a window unless asked to.
"""

from __future__ import annotations

from vtkmuscle.plotting.export import export_scene
from vtkmuscle.plotting.figures import (
    plot_lengths,
    plot_muscle,
    plot_rest_pose,
    plot_volume,
)
from vtkmuscle.plotting.moment_arms import plot_moment_arms
from vtkmuscle.plotting.movie import check_movie, write_movie
from vtkmuscle.plotting.moving import MovingScene, Pose
from vtkmuscle.plotting.preflight import can_render
from vtkmuscle.plotting.studio import Studio
from vtkmuscle.plotting.surfaces import make_plotter
from vtkmuscle.plotting.times import add_time_slider, show_time
from vtkmuscle.plotting.views import View, choose_view, framed

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
    "plot_volume",
    "show_time",
    "write_movie",
]
